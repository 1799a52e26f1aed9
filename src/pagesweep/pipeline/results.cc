// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/pipeline/results.h"

#include <fmt/format.h>

#include <cmath>
#include <regex>

#include "pagesweep/base/error.h"
#include "pagesweep/io/float_tiff.h"
#include "pagesweep/io/ply_file.h"

namespace pagesweep {
namespace {

namespace fs = std::filesystem;

struct MapFiles {
  MapFiles(const fs::path& folder, const std::string& camera)
      : points(folder / (camera + "_points.tiff")),
        sigma(folder / (camera + "_point_sigma.tiff")),
        intensity(folder / (camera + "_intensity.tiff")),
        status(folder / (camera + "_status.png")),
        times(folder / (camera + "_times.tiff")),
        clipped(folder / (camera + "_clipped.png")) {}
  fs::path points, sigma, intensity, status, times, clipped;
};

ImageView<const std::uint8_t> bytes_of(const Image<PixelStatus>& status) {
  return {reinterpret_cast<const std::uint8_t*>(status.data()), status.width(), status.height(), status.width()};
}

void write_maps(const MapFiles& files, const PointMap& points, const TimeMap* times) {
  write_float_tiff(files.points, {points.x.view(), points.y.view(), points.z.view()});
  write_float_tiff(files.sigma, {points.sigma.view()});
  write_float_tiff(files.intensity, {points.intensity.view()});
  write_gray_png(files.status, bytes_of(points.status));
  if (times)
    write_float_tiff(files.times,
                     {times->time.view(), times->sigma.view(), times->amplitude.view(), times->residual.view()});
  else
    fs::remove(files.times);  // of an earlier run
}

Image<PixelStatus> read_status(const fs::path& file, const Camera& camera) {
  const GrayImage image = read_gray(file, ImageSize{camera.width, camera.height});
  const auto* bytes = std::get_if<Image<std::uint8_t>>(&image);
  if (!bytes) throw bad_input(file, "", "expected 8 bit a pixel, as pagesweep writes it");
  Image<PixelStatus> status(camera.width, camera.height);
  for (std::size_t i = 0; i < status.size(); ++i) {
    const std::uint8_t value = bytes->data()[i];
    if (value >= names_of(PixelStatus{}).size())
      throw bad_input(file, fmt::format("pixel {}", i), fmt::format("{} is no pixel status", value));
    status.data()[i] = static_cast<PixelStatus>(value);
  }
  return status;
}

PointMap read_maps(const MapFiles& files, const Camera& camera) {
  auto points = read_float_tiff(files.points, 3);
  auto sigma = read_float_tiff(files.sigma, 1);
  auto intensity = read_float_tiff(files.intensity, 1);
  for (const auto* channels : {&points, &sigma, &intensity})
    if (channels->front().width() != camera.width || channels->front().height() != camera.height)
      throw bad_input(files.points, "",
                      fmt::format("this and its neighbours should have the {} x {} pixels of camera '{}' in the rig",
                                  camera.width, camera.height, camera.name));
  PointMap map(camera.width, camera.height);
  map.x = std::move(points[0]);
  map.y = std::move(points[1]);
  map.z = std::move(points[2]);
  map.sigma = std::move(sigma[0]);
  map.intensity = std::move(intensity[0]);
  map.status = read_status(files.status, camera);
  for (std::size_t i = 0; i < map.status.size(); ++i)
    if (map.status.data()[i] == PixelStatus::ok && !std::isfinite(map.x.data()[i] + map.y.data()[i] + map.z.data()[i]))
      throw bad_input(files.points, fmt::format("pixel {}", i), "has no point although its status is ok");
  return map;
}

void write_surface(const fs::path& file, const PageSurface& surface) {
  std::vector<Image<float>> channels(6, Image<float>(surface.columns(), surface.rows()));
  for (int j = 0; j < surface.rows(); ++j)
    for (int i = 0; i < surface.columns(); ++i)
      for (int axis = 0; axis < 3; ++axis) {
        channels[static_cast<std::size_t>(axis)](i, j) = surface.model(i, j)[axis];
        channels[static_cast<std::size_t>(3 + axis)](i, j) = surface.measured(i, j)[axis];
      }
  std::vector<ImageView<const float>> views;
  for (const auto& channel : channels) views.push_back(channel.view());
  write_float_tiff(file, views);
}

void remove_old_pages(const fs::path& folder) {
  if (!fs::is_directory(folder)) return;
  static const std::regex ours("page_[0-9]+(\\.png|\\.tiff|_scanmap\\.tiff|_surface\\.tiff)");
  std::vector<fs::path> old;
  for (const auto& entry : fs::directory_iterator(folder))
    if (std::regex_match(entry.path().filename().string(), ours)) old.push_back(entry.path());
  for (const auto& file : old) fs::remove(file);
}

}  // namespace

void write_measurement(const fs::path& folder, const Measurement& measurement) {
  write_ply(folder / "points.ply", measurement.points);
  for (std::size_t c = 0; c < measurement.points.size(); ++c) {
    const MapFiles files(folder, measurement.cameras[c].name);
    write_maps(files, measurement.points[c], measurement.timing ? &measurement.timing->maps[c] : nullptr);
    if (!measurement.clipped_frames.empty()) write_gray_png(files.clipped, measurement.clipped_frames[c].view());
  }
}

Measurement read_measurement(const fs::path& folder, const Rig& rig) {
  Measurement measurement;
  for (const Camera& camera : rig.cameras) {
    const MapFiles files(folder, camera.name);
    if (!fs::exists(files.points)) continue;
    measurement.cameras.push_back(camera);
    measurement.points.push_back(read_maps(files, camera));
  }
  if (measurement.points.empty())
    throw cannot_read(folder, "it holds no points of the rig's cameras: run `pagesweep scan` or `reconstruct` first");
  measurement.dropped_frames.resize(measurement.points.size());
  return measurement;
}

void write_pages(const fs::path& folder, std::span<const Page> pages, std::span<const PageSurface> surfaces,
                 const PageFileOptions& options) {
  remove_old_pages(folder);
  for (std::size_t i = 0; i < pages.size(); ++i) {
    const std::string name = fmt::format("page_{}", pages[i].index);
    write_picture(folder / fmt::format("{}.{}", name, name_of(options.format)), pages[i].picture, options.picture);
    write_scan_map(folder / (name + "_scanmap.tiff"), pages[i].scan_map);
    write_surface(folder / (name + "_surface.tiff"), surfaces[i]);
  }
}

}  // namespace pagesweep
