// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/pipeline/check_capture.h"

#include <fmt/format.h>

#include "pagesweep/base/error.h"
#include "pagesweep/pipeline/scan_page.h"

namespace pagesweep {

RigCheck check_capture(FrameSource& frames, const Rig& rig, const Picture* scan, const DriftPriors& priors,
                       Progress& progress) {
  if (scan && rig.scanner && (scan->width() != rig.scanner->width() || scan->height() != rig.scanner->height()))
    throw Error(ErrorKind::bad_input,
                fmt::format("the scan has {} x {} pixels but the rig's scanner {} x {}: they do not belong together",
                            scan->width(), scan->height(), rig.scanner->width(), rig.scanner->height()));
  // A sheet of light that these points calibrate, and edges that the scan corrects, would hide what is looked for.
  ScanOptions options;
  options.fusion = false;
  options.edges = EdgeWitness::amplitude;
  const Measurement measured = reconstruct(frames, rig, options, progress);
  progress.begin("looking for the same print in all pictures");
  const auto& times = measured.timing->maps;
  return check_rig({rig, measured.cameras[0], measured.cameras[1], times[0], times[1], measured.points[0], scan},
                   priors);
}

}  // namespace pagesweep
