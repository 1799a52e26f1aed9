// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/yaml_file.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/words_internal.h"

namespace pagesweep {
namespace {

using nlohmann::json;

/// A calibration with all its image points has a megabyte.
constexpr std::size_t most_bytes = std::size_t{16} << 20;
constexpr int most_values = 1'000'000;
constexpr int deepest = 30;

/// Turns YAML into JSON. Aliases make YAML a graph, even one with circles, and JSON is a tree: hence the limits.
class Conversion {
 public:
  explicit Conversion(const std::filesystem::path& file) : file_(file) {}

  json convert(const YAML::Node& node, int depth = 0) {
    if (++values_ > most_values || depth > deepest)
      throw bad_input(file_, "", "expected the few numbers of a calibration, found far more, or values in a circle");
    if (node.IsScalar()) return scalar(node);
    if (node.IsSequence()) return sequence(node, depth);
    if (node.IsMap()) return map(node, depth);
    return nullptr;
  }

 private:
  static json scalar(const YAML::Node& node) {
    const bool is_quoted = node.Tag() == "!";
    const auto number = is_quoted ? std::nullopt : number_in(node.Scalar());
    return number && std::isfinite(*number) ? json(*number) : json(node.Scalar());
  }

  json sequence(const YAML::Node& node, int depth) {
    json items = json::array();
    for (const auto& item : node) items.push_back(convert(item, depth + 1));
    return items;
  }

  json map(const YAML::Node& node, int depth) {
    json fields = json::object();
    for (const auto& field : node)
      if (field.first.IsScalar()) fields.emplace(field.first.Scalar(), convert(field.second, depth + 1));
    return fields;
  }

  const std::filesystem::path& file_;
  int values_ = 0;
};

std::string readable_text(const std::filesystem::path& file) {
  std::string text = read_bytes(file, most_bytes);
  if (const auto first = text.find_first_not_of(" \t\r\n"); first != std::string::npos && text[first] == '<')
    throw bad_input(file, "", "expected YAML, found XML: OpenCV writes YAML into files whose names end in .yml");
  if (text.starts_with("%YAML")) text[0] = '#';  // a comment: lines keep their numbers
  return text;
}

}  // namespace

JsonReader read_yaml(const std::filesystem::path& file) {
  const std::string text = readable_text(file);
  json root;
  try {
    root = Conversion(file).convert(YAML::Load(text));
  } catch (const YAML::Exception& e) {
    throw bad_input(file, fmt::format("line {}, column {}", e.mark.line + 1, e.mark.column + 1),
                    "expected YAML: " + e.msg);
  }
  return JsonReader::parse(root.dump(-1, ' ', false, json::error_handler_t::replace), file);
}

}  // namespace pagesweep
