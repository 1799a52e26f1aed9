// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>

#include "pagesweep/data/picture.h"
#include "pagesweep/live/genicam_camera.h"

namespace pagesweep {

/// The scanner's picture of a sweep that is under way.
class ScanPictureSource {
 public:
  virtual ~ScanPictureSource() = default;
  /// The whole picture, when it is there.
  /// \param longest  to wait for something new
  /// \throws Error  if it does not come, or is of another size than the rig's scanner
  virtual Picture finish(std::chrono::milliseconds longest) = 0;
};

/// A picture that is assembled from the rows of a line camera: the first row that it sends is the scan's first one, or
/// the last if it is set as reversed. It is started at once and has to be triggered by the head's movement.
/// \param height  [px] of the scan
std::unique_ptr<ScanPictureSource> take_lines(std::unique_ptr<GenicamCamera> camera, int height);

/// A picture that appears in a folder from now on. Programs write slowly: a file is taken when it has stopped growing
/// and can be read to its end.
/// \param width, height  [px] of the scan
/// \throws Error  if there is no such folder
std::unique_ptr<ScanPictureSource> watch_folder(const std::filesystem::path& folder, int width, int height);

}  // namespace pagesweep
