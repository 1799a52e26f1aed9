// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/pipeline/results.h"

#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/io/color_profile.h"
#include "pagesweep/io/float_tiff.h"
#include "pagesweep/io/image_codecs.h"
#include "pagesweep/io/page_metadata.h"
#include "pagesweep/io/page_name.h"
#include "pagesweep/io/pages_file.h"
#include "pagesweep/io/ply_file.h"
#include "pagesweep/io/result_files.h"

namespace pagesweep {
namespace {

namespace fs = std::filesystem;

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

std::vector<std::string> names_of_pages(const std::vector<int>& indices, const PageFileOptions& options,
                                        const PageOrigin& origin) {
  std::vector<PageNaming> naming;
  for (const int index : indices)
    naming.push_back(
        {options.first_page + index - 1, index, side_of(index, static_cast<int>(indices.size())), origin.capture});
  return PageNamePattern(options.page_name).names(naming);
}

/// The picture as it goes into its file.
Picture finished(const Page& page, const PageFileOptions& options, const PageOrigin& origin) {
  Picture picture = options.format == PageFormat::jpeg ? with_8_bit(page.picture) : page.picture;
  complete_profile(picture);
  complete_metadata(picture, {.title = origin.capture + ", page " + std::to_string(page.index),
                              .source = origin.capture,
                              .program = origin.program});
  return picture;
}

void write_maps(const PageFiles& files, const Page& page, const PageSurface& surface) {
  write_scan_map(files.scan_map, page.scan_map);
  write_surface(files.surface, surface);
  if (surface.strain.size() > 0) write_float_tiff(files.strain, {surface.strain.view(), surface.strain_sigma.view()});
}

void write_camera(const fs::path& folder, const Measurement& measurement, std::size_t camera) {
  const CameraFiles files(folder, measurement.cameras[camera].name);
  write_point_map(files, measurement.points[camera]);
  if (measurement.timing)
    write_time_map(files, measurement.timing->maps[camera]);
  else
    fs::remove(files.times);  // of an earlier run
  if (!measurement.clipped_frames.empty()) write_gray_png(files.clipped, measurement.clipped_frames[camera].view());
}

void remove_old_pages(const fs::path& folder) {
  if (!fs::is_directory(folder)) return;
  for (const int index : pages_in(folder)) {
    const PageFiles files(folder, index);
    for (const fs::path& picture : files.pictures()) fs::remove(picture);
    fs::remove(files.surface);
    fs::remove(files.strain);
    fs::remove(files.scan_map);
  }
  fs::remove(folder / "pages.json");
}

}  // namespace

void check(const PageFileOptions& options) { names_of_pages({1, 2}, options, {}); }

void write_measurement(const fs::path& folder, const Measurement& measurement) {
  const auto cameras = static_cast<int>(measurement.points.size());
  parallel_rows(cameras + 1, [&](int c) {
    if (c == cameras)
      write_ply(folder / "points.ply", measurement.points);
    else
      write_camera(folder, measurement, static_cast<std::size_t>(c));
  });
}

Measurement read_measurement(const fs::path& folder, const Rig& rig) {
  Measurement measurement;
  for (const Camera& camera : rig.cameras) {
    auto points = read_point_map(CameraFiles(folder, camera.name), camera);
    if (!points) continue;
    measurement.cameras.push_back(camera);
    measurement.points.push_back(*std::move(points));
  }
  if (measurement.points.empty())
    throw cannot_read(folder, "it holds no points of the rig's cameras: run `pagesweep scan` or `reconstruct` first");
  measurement.dropped_frames.resize(measurement.points.size());
  return measurement;
}

void write_pages(const fs::path& folder, std::span<const Page> pages, std::span<const PageSurface> surfaces,
                 const PageFileOptions& options, const PageOrigin& origin) {
  std::vector<int> indices;
  for (const Page& page : pages) indices.push_back(page.index);
  const std::vector<std::string> names = names_of_pages(indices, options, origin);
  remove_old_pages(folder);
  PagesFile index{origin.capture, {}};
  for (std::size_t i = 0; i < pages.size(); ++i)
    index.pages.push_back({pages[i].index, names[i] + "." + std::string(extension_of(options.format)),
                           side_of(pages[i].index, static_cast<int>(pages.size()))});
  parallel_rows(static_cast<int>(pages.size()), [&](int n) {
    const auto i = static_cast<std::size_t>(n);
    write_maps(PageFiles(folder, pages[i].index), pages[i], surfaces[i]);
    write_picture(folder / index.pages[i].picture, finished(pages[i], options, origin), options.picture);
  });
  write_pages_file(folder, index);
}

}  // namespace pagesweep
