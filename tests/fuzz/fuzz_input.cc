// SPDX-License-Identifier: Apache-2.0
// One fuzzer a format: whatever the bytes are, a reader returns or throws pagesweep::Error. Anything else ends the
// process, which is what libFuzzer looks for.
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <string>

#include "pagesweep/base/error.h"
#include "pagesweep/io/capture_file.h"
#include "pagesweep/io/colmap_rig.h"
#include "pagesweep/io/float_tiff.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/kalibr_rig.h"
#include "pagesweep/io/opencv_rig.h"
#include "pagesweep/io/ply_file.h"
#include "pagesweep/io/recording_file.h"
#include "pagesweep/io/rig_file.h"
#include "pagesweep/io/truth_file.h"

namespace {

void read(const std::filesystem::path& file) {
#if defined(PAGESWEEP_FUZZ_rig)
  pagesweep::read_rig(file);
#elif defined(PAGESWEEP_FUZZ_capture)
  pagesweep::read_capture(file);
#elif defined(PAGESWEEP_FUZZ_truth)
  pagesweep::read_truth(file);
#elif defined(PAGESWEEP_FUZZ_ply)
  pagesweep::read_ply(file);
#elif defined(PAGESWEEP_FUZZ_float_tiff)
  pagesweep::read_float_tiff(file);
#elif defined(PAGESWEEP_FUZZ_recording)
  const pagesweep::RecordingReader reader(file);
  for (int page = 0; page < reader.pages(); ++page) reader.read(page);
#elif defined(PAGESWEEP_FUZZ_opencv_rig)
  pagesweep::read_opencv_rig({&file, 1}, {.width = 640, .height = 480});
#elif defined(PAGESWEEP_FUZZ_kalibr_rig)
  pagesweep::read_kalibr_rig(file);
#elif defined(PAGESWEEP_FUZZ_colmap_rig)
  pagesweep::read_colmap_rig(file, "/dev/null");
#else  // png, tiff: told apart by their first bytes
  pagesweep::read_gray(file);
#endif
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // A file in memory: the readers take paths.
  const int descriptor = ::memfd_create("input", MFD_CLOEXEC);
  if (descriptor < 0 || ::write(descriptor, data, size) != static_cast<ssize_t>(size)) return -1;
  try {
    read("/proc/self/fd/" + std::to_string(descriptor));
  } catch (const pagesweep::Error&) {
  }
  ::close(descriptor);
  return 0;
}
