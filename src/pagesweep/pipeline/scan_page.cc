// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/pipeline/scan_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pagesweep/base/error.h"
#include "pagesweep/matching/match_sequences.h"
#include "pagesweep/timing/pairwise.h"
#include "pagesweep/triangulation/section_light.h"

namespace pagesweep {
namespace {

/// The rig's calibration of each camera of the source.
std::vector<Camera> cameras_of(const FrameSource& source, const Rig& rig, Matcher matcher) {
  std::vector<Camera> cameras;
  for (const Sequence& sequence : source.sequences()) {
    const Camera* camera = rig.find_camera(sequence.camera);
    if (!camera)
      throw Error(ErrorKind::bad_input,
                  fmt::format("the rig has no camera '{}', which the capture holds frames of: name it as the rig does",
                              sequence.camera));
    cameras.push_back(*camera);
  }
  if (matcher == Matcher::light_section) {
    if (!rig.light)
      throw Error(ErrorKind::bad_input,
                  "light sectioning needs the rig's \"light\": calibrate it, or match two cameras");
  } else if (cameras.size() != 2) {
    throw Error(ErrorKind::bad_input,
                fmt::format("matching needs two cameras and the capture has {}: use --matcher light-section for one",
                            cameras.size()));
  }
  return cameras;
}

MatchPair match(const std::vector<Frames>& frames, const Measurement& measurement, const ScanOptions& options,
                Progress& progress) {
  const auto& cameras = measurement.cameras;
  if (options.matcher == Matcher::sequence)
    return match_sequences(frames[0], frames[1], cameras[0], cameras[1], options.matching, progress);
  const auto& times = measurement.timing->maps;
  MatchPair matches = match_times(times[0], times[1], cameras[0], cameras[1], options.matching, progress);
  if (options.timing.estimator == TimeEstimator::pairwise) {
    matches.from_first = shift_pairwise(matches.from_first, frames[0], frames[1], times[1], options.timing);
    matches.from_second = shift_pairwise(matches.from_second, frames[1], frames[0], times[0], options.timing);
  }
  return matches;
}

/// The direction, in the rig's xy plane, in which the scan's columns count: the reader's right.
double reading_direction(const Scanner& scanner) {
  const auto ray = scanner.ray({0.5 * (scanner.width() - 1), 0.5 * (scanner.height() - 1)});
  const auto middle = ray ? Plane{Eigen::Vector3d::UnitZ(), 0}.meet(*ray) : std::nullopt;
  if (!middle) throw Error(ErrorKind::bad_input, "the rig's scanner does not look at the table z = 0");
  const Matrix23d scan_from_table = scanner.project_jacobian(*middle);
  // Along it v stays and u grows.
  const Eigen::Vector2d along_row(scan_from_table(1, 1), -scan_from_table(1, 0));
  const bool rightward = scan_from_table.row(0).head<2>().dot(along_row) > 0;
  return rightward ? std::atan2(along_row.y(), along_row.x()) : std::atan2(-along_row.y(), -along_row.x());
}

}  // namespace

Measurement reconstruct(FrameSource& source, const Rig& rig, const ScanOptions& options, Progress& progress) {
  Measurement measurement;
  measurement.cameras = cameras_of(source, rig, options.matcher);
  const std::vector<Frames> frames = read_all(source, progress);
  for (const Frames& sequence : frames) {
    measurement.dropped_frames.push_back(sequence.dropped());
    measurement.clipped_frames.push_back(count_clipped(sequence));
  }

  if (options.matcher != Matcher::sequence) measurement.timing = estimate_times(frames, options.timing, progress);

  if (options.matcher == Matcher::light_section) {
    for (std::size_t c = 0; c < frames.size(); ++c)
      measurement.points.push_back(
          section_light(measurement.timing->maps[c], measurement.cameras[c], *rig.light, options.triangulation));
    return measurement;
  }

  const MatchPair matches = match(frames, measurement, options, progress);
  const auto intensity = [&](std::size_t c) {
    return measurement.timing ? measurement.timing->maps[c].amplitude : brightest(frames[c]);
  };
  const auto& [first, second] = std::tie(measurement.cameras[0], measurement.cameras[1]);
  progress.begin("triangulating");
  measurement.points.push_back(triangulate(matches.from_first, intensity(0), first, second, options.triangulation));
  measurement.points.push_back(triangulate(matches.from_second, intensity(1), second, first, options.triangulation));
  return measurement;
}

Scan flatten(Measurement measurement, const Picture& picture, const Rig& rig, const ScanOptions& options,
             Progress& progress) {
  if (!rig.scanner)
    throw Error(ErrorKind::bad_input, "the rig has no \"scanner\": without it no picture can be flattened");
  if (picture.width() != rig.scanner->width() || picture.height() != rig.scanner->height())
    throw Error(ErrorKind::bad_input,
                fmt::format("the scan has {} x {} pixels but the rig's scanner {} x {}: they do not belong together",
                            picture.width(), picture.height(), rig.scanner->width(), rig.scanner->height()));
  SurfaceOptions surface_options = options.surface;
  surface_options.reading_direction_rad = reading_direction(*rig.scanner);

  Scan scan;
  scan.measurement = std::move(measurement);
  scan.surfaces = fit_surface(scan.measurement.points, surface_options, progress);
  scan.pages = dewarp(scan.surfaces, picture, *rig.scanner, options.dewarp, progress);
  return scan;
}

Scan scan_page(FrameSource& frames, const Picture& scan, const Rig& rig, const ScanOptions& options,
               Progress& progress) {
  return flatten(reconstruct(frames, rig, options, progress), scan, rig, options, progress);
}

}  // namespace pagesweep
