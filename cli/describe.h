// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pagesweep/io/capture_file.h"
#include "pagesweep/io/json_reader.h"
#include "pagesweep/io/ply_file.h"
#include "pagesweep/io/truth_file.h"

namespace pagesweep::cli {

/// What something is, for people and for programs.
struct Description {
  std::vector<std::string> lines;
  nlohmann::ordered_json json;

  /// Takes a part in, its lines indented.
  void add(const std::string& key, const Description& part);
  std::string text() const;
};

Description describe_capture(const Capture& capture, std::span<const Frames> frames);
Description describe_rig(const Rig& rig);
Description describe_picture(const std::filesystem::path& file, const Picture& picture);
Description describe_points(const PointCloud& cloud);
Description describe_truth(const Truth& truth);
/// The figures of a finished run.
Description describe_report(const JsonReader& report);

}  // namespace pagesweep::cli
