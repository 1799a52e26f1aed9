// SPDX-License-Identifier: Apache-2.0
#include "cli/board_pictures.h"

#include <fmt/format.h>
#include <glob.h>

#include <algorithm>
#include <bit>
#include <map>
#include <set>

#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/io/image_file.h"

namespace pagesweep::cli {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> files_like(const std::string& pattern) {
  glob_t found{};
  std::vector<fs::path> files;
  if (::glob(pattern.c_str(), GLOB_TILDE, nullptr, &found) == 0)
    for (std::size_t k = 0; k < found.gl_pathc; ++k)
      if (fs::is_regular_file(found.gl_pathv[k])) files.emplace_back(found.gl_pathv[k]);
  ::globfree(&found);
  std::ranges::sort(files);
  return files;
}

/// The pose that each picture shows, by name or by place in the list.
std::vector<std::string> name_poses(const std::vector<const PictureList*>& lists,
                                    std::vector<std::vector<std::string>>& names_of_lists) {
  std::map<std::string, int> uses;
  std::set<std::size_t> lengths;
  for (const PictureList* list : lists) {
    auto& names = names_of_lists.emplace_back();
    for (const fs::path& file : list->files) names.push_back(file.stem().string());
    for (const std::string& name : std::set<std::string>(names.begin(), names.end())) ++uses[name];
    lengths.insert(list->files.size());
  }
  const bool any_shared = std::ranges::any_of(uses, [](const auto& use) { return use.second > 1; });
  if (!any_shared && lists.size() > 1 && lengths.size() == 1)
    for (auto& names : names_of_lists) names = names_of_lists.front();
  std::set<std::string> poses;
  for (const auto& names : names_of_lists) poses.insert(names.begin(), names.end());
  return {poses.begin(), poses.end()};
}

SensorPictures search(const PictureList& list, const std::vector<std::string>& names,
                      const std::vector<std::string>& poses, const Board& board, const DetectionOptions& options) {
  SensorPictures sensor;
  sensor.name = list.sensor;
  sensor.pictures.resize(list.files.size());
  std::vector<ImageSize> sizes(list.files.size());
  parallel_rows(static_cast<int>(list.files.size()), [&](int k) {
    const auto i = static_cast<std::size_t>(k);
    const Image<std::uint8_t> gray = gray_of(read_picture(list.files[i]));
    sizes[i] = {gray.width(), gray.height()};
    const auto pose = std::ranges::find(poses, names[i]) - poses.begin();
    sensor.pictures[i] = {static_cast<int>(pose), list.files[i].string(), detect_board(gray.view(), board, options)};
  });
  sensor.width = sizes.front().width, sensor.height = sizes.front().height;
  for (std::size_t i = 0; i < sizes.size(); ++i)
    if (sizes[i].width != sensor.width || sizes[i].height != sensor.height)
      throw bad_input(
          list.files[i], "",
          fmt::format("has {} x {} px, but {} has {} x {}: all pictures of {} must be of one size", sizes[i].width,
                      sizes[i].height, list.files.front().string(), sensor.width, sensor.height, list.sensor));
  return sensor;
}

}  // namespace

Image<std::uint8_t> gray_of(const Picture& picture) {
  Image<std::uint8_t> gray(picture.width(), picture.height());
  const int channel = picture.channels == 3 ? 1 : 0;
  const auto convert = [&](const auto& samples) {
    unsigned most = 255;
    if (picture.bit_depth() == 16)  // 10 and 12 bit cameras use the lower bits only
      for (const auto sample : samples.pixels()) most = std::max(most, unsigned(sample));
    const int shift = std::bit_width(most) - 8;
    for (int y = 0; y < gray.height(); ++y)
      for (int x = 0; x < gray.width(); ++x)
        gray(x, y) = static_cast<std::uint8_t>(samples(x * picture.channels + channel, y) >> shift);
  };
  std::visit(convert, picture.samples);
  return gray;
}

PictureList list_pictures(const std::string& text, const std::string& sensor) {
  const auto equals = text.find('=');
  PictureList list{sensor, {}};
  std::string pattern = text;
  if (sensor.empty()) {
    if (equals == std::string::npos || equals == 0)
      throw std::invalid_argument(fmt::format("--camera: expected NAME=FILES like cam1=left/*.png, found '{}'", text));
    list.sensor = text.substr(0, equals);
    pattern = text.substr(equals + 1);
  }
  list.files = files_like(pattern);
  if (list.files.empty()) throw cannot_read(pattern, "no file is called like this");
  return list;
}

CalibrationInput find_boards(const Board& board, const std::vector<PictureList>& cameras, const PictureList* scanner,
                             const DetectionOptions& options, Progress& progress) {
  std::vector<const PictureList*> lists;
  for (const PictureList& camera : cameras) lists.push_back(&camera);
  if (scanner) lists.push_back(scanner);
  CalibrationInput input{board, {}, {}};
  std::vector<std::vector<std::string>> names;
  input.poses = name_poses(lists, names);
  for (std::size_t k = 0; k < lists.size(); ++k) {
    progress.begin("looking for the board in the pictures of " + lists[k]->sensor);
    input.sensors.push_back(search(*lists[k], names[k], input.poses, board, options));
  }
  if (scanner) input.sensors.back().is_scanner = true;
  return input;
}

}  // namespace pagesweep::cli
