// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/rig_conversion.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <vector>

#include "pagesweep/base/error.h"
#include "pagesweep/io/colmap_rig.h"
#include "pagesweep/io/kalibr_rig.h"
#include "pagesweep/io/opencv_rig.h"
#include "pagesweep/io/rig_fields_internal.h"
#include "pagesweep/io/words_internal.h"
#include "pagesweep/io/yaml_file.h"

namespace pagesweep {
namespace {

namespace fs = std::filesystem;

double mm_per_unit(const std::string& unit) {
  if (unit == "mm") return 1;
  if (unit == "cm") return 10;
  if (unit == "m") return 1000;
  const auto number = number_in(unit);
  if (!number || !(*number >= 1e-6 && *number <= 1e6))
    throw std::invalid_argument(fmt::format("--unit: expected mm, cm, m or a number of millimetres, found '{}'", unit));
  return *number;
}

void expect_metres(const std::string& unit) {
  if (unit != "mm" && mm_per_unit(unit) != 1000)  // mm is what was not given
    throw std::invalid_argument(fmt::format("--unit: Kalibr's lengths are metres, and not '{}'", unit));
}

std::optional<int> length_in_pixels(std::string_view text) {
  const auto number = number_in(text);
  if (!number || *number != std::floor(*number) || !(*number >= 1 && *number <= widest_px)) return std::nullopt;
  return static_cast<int>(*number);
}

OpenCvHints hints_of(const RigConversionOptions& options) {
  OpenCvHints hints;
  hints.mm_per_unit = mm_per_unit(options.unit);
  if (options.image_size.empty()) return hints;
  const std::string_view text = options.image_size;
  const auto cross = std::min(text.find('x'), text.size());
  const auto width = length_in_pixels(text.substr(0, cross));
  const auto height = cross < text.size() ? length_in_pixels(text.substr(cross + 1)) : std::nullopt;
  if (!width || !height)
    throw std::invalid_argument(fmt::format("--image-size: expected 1024x768, found '{}'", options.image_size));
  hints.width = *width;
  hints.height = *height;
  return hints;
}

std::vector<std::string> split(std::string_view text, char separator) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == separator)
      parts.emplace_back();
    else
      parts.back() += c;
  }
  return parts;
}

void rename_cameras(Rig& rig, const std::string& text) {
  const auto names = split(text, ',');
  if (names.size() != rig.cameras.size())
    throw std::invalid_argument(
        fmt::format("--names: expected {} names with commas between, found '{}'", rig.cameras.size(), text));
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (!is_camera_name(names[i]) || std::ranges::count(names, names[i]) > 1)
      throw std::invalid_argument(
          fmt::format("--names: expected different names without slashes and leading dots, "
                      "found '{}'",
                      text));
    rig.cameras[i].name = names[i];
  }
}

bool is_yaml(const fs::path& file) { return file.extension() == ".yml" || file.extension() == ".yaml"; }

RigFormat format_of_folder(const fs::path& folder) {
  if (fs::exists(folder / "cameras.txt") || fs::exists(folder / "cameras.bin")) return RigFormat::colmap;
  if (fs::exists(folder / "intrinsics.yml")) return RigFormat::opencv;
  throw bad_input(folder, "", "holds neither COLMAP's cameras.txt and images.txt nor OpenCV's intrinsics.yml");
}

RigFormat format_of(const fs::path& input) {
  if (!fs::exists(input)) throw cannot_read(input, "there is no such file or folder");
  if (fs::is_directory(input)) return format_of_folder(input);
  if (input.extension() == ".txt") return RigFormat::colmap;
  const JsonReader json = read_yaml(input);
  if (!json.is_object()) return RigFormat::opencv;
  for (const std::string& name : json.names()) {
    const auto field = json.find(name);
    if (field && field->is_object() && (field->find("camera_model") || field->find("T_cn_cnm1")))
      return RigFormat::kalibr;
  }
  return RigFormat::opencv;
}

/// One of the files of a format, out of a folder or a list.
fs::path file_named(std::span<const fs::path> inputs, const std::string& name) {
  for (const fs::path& input : inputs) {
    if (fs::is_directory(input)) return input / name;
    if (input.filename() == name) return input;
  }
  throw cannot_read(inputs.front().parent_path() / name, "it is not among the inputs: name the folder, or all files");
}

Rig import_colmap(std::span<const fs::path> inputs, double mm) {
  const fs::path cameras = file_named(inputs, "cameras.txt");
  if (!fs::exists(cameras) && fs::exists(cameras.parent_path() / "cameras.bin"))
    throw cannot_read(cameras,
                      "there is only the binary form of the model: run colmap model_converter with "
                      "--output_type TXT");
  return read_colmap_rig(cameras, file_named(inputs, "images.txt"), mm);
}

Rig import_opencv(std::span<const fs::path> inputs, const OpenCvHints& hints) {
  std::vector<fs::path> files;
  for (const fs::path& input : inputs) {
    if (fs::is_directory(input))
      files.insert(files.end(), {input / "intrinsics.yml", input / "extrinsics.yml"});
    else
      files.push_back(input);
  }
  return read_opencv_rig(files, hints);
}

RigFormat format_for(const fs::path& output) {
  if (is_yaml(output))
    return output.filename().string().find("camchain") == std::string::npos ? RigFormat::opencv : RigFormat::kalibr;
  constexpr auto names = names_of(RigFormat{});
  throw std::invalid_argument(fmt::format("--format: '{}' does not tell the format: give {}", output.string(),
                                          fmt::join(names.begin() + 1, names.end(), ", ")));
}

}  // namespace

Rig import_rig(std::span<const fs::path> inputs, const RigConversionOptions& options) {
  if (inputs.empty()) throw std::invalid_argument("import_rig: expected at least one file");
  const RigFormat format = options.format == RigFormat::automatic ? format_of(inputs.front()) : options.format;
  Rig rig;
  if (format == RigFormat::kalibr) {
    expect_metres(options.unit);
    if (inputs.size() > 1) throw std::invalid_argument("a rig of Kalibr is one file");
    rig = read_kalibr_rig(inputs.front());
  } else if (format == RigFormat::colmap) {
    rig = import_colmap(inputs, mm_per_unit(options.unit));
  } else {
    rig = import_opencv(inputs, hints_of(options));
  }
  if (!options.names.empty()) rename_cameras(rig, options.names);
  return rig;
}

RigFormat export_rig(const fs::path& output, const Rig& rig, const RigConversionOptions& options) {
  const RigFormat format = options.format == RigFormat::automatic ? format_for(output) : options.format;
  if (format == RigFormat::kalibr) {
    expect_metres(options.unit);
    write_kalibr_rig(output, rig);
  } else if (format == RigFormat::colmap) {
    write_colmap_rig(output, rig, mm_per_unit(options.unit));
  } else if (format == RigFormat::opencv_stereo) {
    write_opencv_stereo(output, rig, mm_per_unit(options.unit));
  } else {
    write_opencv_rig(output, rig, mm_per_unit(options.unit));
  }
  return format;
}

std::string lost_by_export(const Rig& rig) {
  std::vector<std::string_view> lost;
  if (rig.scanner) lost.emplace_back("scanner");
  if (rig.light) lost.emplace_back("light");
  if (rig.lamp) lost.emplace_back("lamp");
  if (rig.white) lost.emplace_back("white");
  if (std::ranges::any_of(rig.cameras, [](const Camera& camera) { return camera.sensor.has_value(); }))
    lost.emplace_back("sensors");
  return fmt::format("{}", fmt::join(lost, ", "));
}

}  // namespace pagesweep
