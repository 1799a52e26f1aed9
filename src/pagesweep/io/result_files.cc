// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/result_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>

#include "pagesweep/base/error.h"
#include "pagesweep/io/float_tiff.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/pages_file.h"

namespace pagesweep {
namespace {

namespace fs = std::filesystem;

ImageView<const std::uint8_t> bytes_of(const Image<PixelStatus>& status) {
  return {reinterpret_cast<const std::uint8_t*>(status.data()), status.width(), status.height(), status.width()};
}

Image<PixelStatus> read_status(const fs::path& file, const Camera& camera) {
  const GrayImage image = read_gray(file, ImageSize{camera.width, camera.height});
  const auto* bytes = std::get_if<Image<std::uint8_t>>(&image);
  if (!bytes) throw bad_input(file, "", "expected 8 bit a pixel, found 16");
  constexpr std::size_t known = names_of(PixelStatus{}).size();
  Image<PixelStatus> status(camera.width, camera.height);
  for (std::size_t i = 0; i < status.size(); ++i) {
    const std::uint8_t value = bytes->data()[i];
    if (value >= known)
      throw bad_input(file, fmt::format("pixel {}", i),
                      fmt::format("expected a status below {}, found {}", known, value));
    status.data()[i] = static_cast<PixelStatus>(value);
  }
  return status;
}

/// Channels of one size with the picture of the camera.
std::vector<Image<float>> read_channels(const fs::path& file, int channels, const Camera& camera) {
  std::vector<Image<float>> images = read_float_tiff(file, channels);
  if (images[0].width() != camera.width || images[0].height() != camera.height)
    throw bad_input(file, "",
                    fmt::format("expected the size of {}, {} x {}, found {} x {}", camera.name, camera.width,
                                camera.height, images[0].width(), images[0].height()));
  return images;
}

Image<PixelStatus> ok_where_finite(const Image<float>& values) {
  Image<PixelStatus> status(values.width(), values.height(), PixelStatus::not_computed);
  for (std::size_t i = 0; i < values.size(); ++i)
    if (std::isfinite(values.data()[i])) status.data()[i] = PixelStatus::ok;
  return status;
}

/// N of "page_N_scanmap.tiff"; 0 if the name is another.
int page_number(std::string_view name) {
  constexpr std::string_view head = "page_", tail = "_scanmap.tiff";
  if (!name.starts_with(head) || !name.ends_with(tail) || name.size() <= head.size() + tail.size()) return 0;
  name = name.substr(head.size(), name.size() - head.size() - tail.size());
  int number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  return error == std::errc() && end == name.data() + name.size() && number > 0 ? number : 0;
}

}  // namespace

CameraFiles::CameraFiles(const fs::path& folder, const std::string& camera)
    : points(folder / (camera + "_points.tiff")),
      sigma(folder / (camera + "_point_sigma.tiff")),
      intensity(folder / (camera + "_intensity.tiff")),
      status(folder / (camera + "_status.png")),
      times(folder / (camera + "_times.tiff")),
      clipped(folder / (camera + "_clipped.png")) {}

PageFiles::PageFiles(const fs::path& folder, int index)
    : scan_map(folder / fmt::format("page_{}_scanmap.tiff", index)),
      surface(folder / fmt::format("page_{}_surface.tiff", index)),
      strain(folder / fmt::format("page_{}_strain.tiff", index)),
      stem(folder / fmt::format("page_{}", index)) {
  const auto listed = read_pages_file(folder);
  for (const PageEntry& page : listed ? listed->pages : std::vector<PageEntry>{})
    if (page.index == index) named = folder / page.picture;
}

fs::path PageFiles::picture(std::string_view format) const { return fmt::format("{}.{}", stem.string(), format); }

std::vector<fs::path> PageFiles::pictures() const {
  std::vector<fs::path> there;
  if (!named.empty() && fs::exists(named)) there.push_back(named);
  for (const char* format : {"png", "tiff", "tif", "jp2", "jpg", "jpeg"})
    if (picture(format) != named && fs::exists(picture(format))) there.push_back(picture(format));
  return there;
}

std::vector<int> pages_in(const fs::path& folder) {
  std::vector<int> pages;
  for (const auto& entry : fs::directory_iterator(folder))
    if (const int number = page_number(entry.path().filename().string()); number > 0) pages.push_back(number);
  std::sort(pages.begin(), pages.end());
  return pages;
}

void write_point_map(const CameraFiles& files, const PointMap& points) {
  write_float_tiff(files.points, {points.x.view(), points.y.view(), points.z.view()});
  write_float_tiff(files.sigma, {points.sigma.view()});
  write_float_tiff(files.intensity, {points.intensity.view()});
  write_gray_png(files.status, bytes_of(points.status));
}

void write_time_map(const CameraFiles& files, const TimeMap& times) {
  write_float_tiff(files.times, {times.time.view(), times.sigma.view(), times.amplitude.view(), times.residual.view()});
}

std::optional<PointMap> read_point_map(const CameraFiles& files, const Camera& camera) {
  if (!fs::exists(files.points)) return std::nullopt;
  PointMap map(camera.width, camera.height);
  std::vector<Image<float>> xyz = read_channels(files.points, 3, camera);
  map.x.swap(xyz[0]);
  map.y.swap(xyz[1]);
  map.z.swap(xyz[2]);
  if (fs::exists(files.sigma)) map.sigma.swap(read_channels(files.sigma, 1, camera)[0]);
  if (fs::exists(files.intensity)) map.intensity.swap(read_channels(files.intensity, 1, camera)[0]);
  map.status = fs::exists(files.status) ? read_status(files.status, camera) : ok_where_finite(map.z);
  for (std::size_t i = 0; i < map.status.size(); ++i)
    if (map.status.data()[i] == PixelStatus::ok && !std::isfinite(map.x.data()[i] + map.y.data()[i] + map.z.data()[i]))
      throw bad_input(files.points, fmt::format("pixel {}", i), "has no point although its status is ok");
  return map;
}

std::optional<TimeMap> read_time_map(const CameraFiles& files, const Camera& camera) {
  if (!fs::exists(files.times)) return std::nullopt;
  TimeMap map(camera.width, camera.height);
  std::vector<Image<float>> channels = read_channels(files.times, 4, camera);
  map.time.swap(channels[0]);
  map.sigma.swap(channels[1]);
  map.amplitude.swap(channels[2]);
  map.residual.swap(channels[3]);
  map.status = ok_where_finite(map.time);
  return map;
}

}  // namespace pagesweep
