// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pagesweep/camera/camera.h"
#include "pagesweep/data/point_map.h"
#include "pagesweep/data/time_map.h"

namespace pagesweep {

/// The maps of one camera in a folder of results (docs/formats.md, "Results").
struct CameraFiles {
  CameraFiles(const std::filesystem::path& folder, const std::string& camera);
  std::filesystem::path points, sigma, intensity, status, times, clipped;
};

/// One flat page in a folder of results.
struct PageFiles {
  PageFiles(const std::filesystem::path& folder, int index);
  std::filesystem::path picture(std::string_view format) const;  ///< \param format  the extension, such as "png"
  /// The pictures that are there, whatever their format; a name that pages.json gives is the first.
  std::vector<std::filesystem::path> pictures() const;
  std::filesystem::path scan_map, surface, strain;

 private:
  std::filesystem::path stem, named;
};

/// Numbers of the pages that have a scan map in the folder, in order.
std::vector<int> pages_in(const std::filesystem::path& folder);

void write_point_map(const CameraFiles& files, const PointMap& points);
void write_time_map(const CameraFiles& files, const TimeMap& times);

/// Reads a camera's points. Of a result that other programs made, only NAME_points.tiff is needed: a pixel without
/// status is `ok` where it has a point, and other missing maps are NaN.
/// \return  nothing if there is no NAME_points.tiff
/// \throws Error  if a file cannot be read, does not have the camera's size, or calls a pixel `ok` that has no point
std::optional<PointMap> read_point_map(const CameraFiles& files, const Camera& camera);

/// Reads a camera's time values; those that are finite are `ok`.
/// \return  nothing if there is no NAME_times.tiff
/// \throws Error  if the file cannot be read or does not have the camera's size
std::optional<TimeMap> read_time_map(const CameraFiles& files, const Camera& camera);

}  // namespace pagesweep
