// SPDX-License-Identifier: Apache-2.0
// Scans a capture folder and says how large its pages are.
#include <cmath>
#include <iostream>

#include "pagesweep/base/error.h"
#include "pagesweep/io/capture_file.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/pipeline/scan_page.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: scan_folder CAPTURE\n";
    return 2;
  }
  try {
    const auto capture = pagesweep::read_capture(argv[1]);
    if (!capture.scan) throw pagesweep::no_result("the capture has no scan to flatten");
    const auto rig = pagesweep::read_capture_rig(capture);
    const auto frames = pagesweep::open_capture(capture, rig);
    const auto scan = pagesweep::scan_page(*frames, pagesweep::read_picture(*capture.scan_path()), rig);
    for (const auto& page : scan.pages) {
      const auto millimetres = [&](int pixels) { return std::lround(pixels / page.picture.pixels_per_mm); };
      std::cout << "page " << page.index << ": " << millimetres(page.picture.width()) << " x "
                << millimetres(page.picture.height()) << " mm\n";
    }
  } catch (const std::exception& error) {
    std::cerr << "scan_folder: " << error.what() << "\n";
    return 1;
  }
}
