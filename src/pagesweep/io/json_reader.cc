// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/json_reader.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>

#include "pagesweep/io/atomic_file.h"

namespace pagesweep {
namespace {

using nlohmann::json;

/// A rig or a scene has a few kilobytes; what is larger than this is something else.
constexpr std::size_t most_bytes = std::size_t{64} << 20;
constexpr double unit_length_tolerance = 1e-4;
constexpr double rotation_tolerance = 1e-4;
/// What double precision leaves of a product of rotations: such a matrix is kept to the last bit.
constexpr double rounding = 1e-14;

const json& value_at(const void* value) { return *static_cast<const json*>(value); }

std::string article_and_type(const json& value) {
  switch (value.type()) {
    case json::value_t::null:
      return "null";
    case json::value_t::object:
      return "an object";
    case json::value_t::array:
      return "an array";
    case json::value_t::boolean:
      return "true or false";
    case json::value_t::string:
      return "a string";
    default:
      return "a number";
  }
}

std::string line_and_column(std::string_view text, std::size_t byte) {
  const auto before = text.substr(0, byte > 0 ? byte - 1 : 0);
  const auto line_start = before.rfind('\n');
  const auto column = line_start == std::string_view::npos ? before.size() : before.size() - line_start - 1;
  return fmt::format("line {}, column {}", 1 + std::count(before.begin(), before.end(), '\n'), 1 + column);
}

}  // namespace

struct JsonReader::Document {
  std::filesystem::path file;
  json root;
};

JsonReader::JsonReader(std::shared_ptr<const Document> document, const void* value, std::string place)
    : document_(std::move(document)), value_(value), place_(std::move(place)) {}

JsonReader JsonReader::read(const std::filesystem::path& file) { return parse(read_bytes(file, most_bytes), file); }

JsonReader JsonReader::parse(std::string_view text, const std::filesystem::path& file) {
  auto document = std::make_shared<Document>();
  document->file = file;
  try {
    document->root = json::parse(text);
  } catch (const json::parse_error& e) {
    throw bad_input(file, line_and_column(text, e.byte),
                    "expected JSON (which has neither comments, trailing commas nor NaN)");
  } catch (const json::exception&) {
    throw bad_input(file, "", "expected JSON with finite numbers, found one too large for a double");
  }
  const json* root = &document->root;
  return {std::move(document), root, ""};
}

const std::filesystem::path& JsonReader::file() const { return document_->file; }

Error JsonReader::error(const std::string& problem) const { return bad_input(file(), place_, problem); }

Error JsonReader::unexpected(std::string_view expected) const {
  return error(fmt::format("expected {}, found {}", expected, article_and_type(value_at(value_))));
}

void JsonReader::expect_format(std::string_view format, int version) const {
  const JsonReader found = at("format");
  if (found.text() != format) throw found.error(fmt::format("expected \"{}\", found \"{}\"", format, found.text()));
  const JsonReader number = at("version");
  if (number.number() != version)
    throw number.error(
        fmt::format("expected {}, found {}: this version of pagesweep does not know it", version, number.number()));
}

std::optional<JsonReader> JsonReader::find(std::string_view name) const {
  const json& value = value_at(value_);
  if (!value.is_object()) throw unexpected("an object");
  const auto field = value.find(name);
  if (field == value.end() || field->is_null()) return std::nullopt;
  return JsonReader(document_, &*field, place_.empty() ? std::string(name) : fmt::format("{}.{}", place_, name));
}

JsonReader JsonReader::at(std::string_view name) const {
  if (auto field = find(name)) return *std::move(field);
  const std::string path = place_.empty() ? std::string(name) : fmt::format("{}.{}", place_, name);
  const json& value = value_at(value_);
  throw bad_input(file(), path, value.contains(name) ? "expected a value, found null" : "is missing");
}

std::vector<JsonReader> JsonReader::items() const {
  const json& value = value_at(value_);
  if (!value.is_array()) throw unexpected("an array");
  std::vector<JsonReader> items;
  for (const json& item : value)
    items.push_back(JsonReader(document_, &item, fmt::format("{}[{}]", place_, items.size())));
  return items;
}

std::vector<std::string> JsonReader::names() const {
  const json& value = value_at(value_);
  if (!value.is_object()) throw unexpected("an object");
  std::vector<std::string> names;
  for (const auto& [name, field] : value.items()) names.push_back(name);
  return names;
}

bool JsonReader::is_object() const { return value_at(value_).is_object(); }

bool JsonReader::is_null() const { return value_at(value_).is_null(); }
bool JsonReader::is_array() const { return value_at(value_).is_array(); }

std::string JsonReader::text() const {
  const json& value = value_at(value_);
  if (!value.is_string()) throw unexpected("a string");
  return value.get<std::string>();
}

bool JsonReader::boolean() const {
  const json& value = value_at(value_);
  if (!value.is_boolean()) throw unexpected("true or false");
  return value.get<bool>();
}

double JsonReader::number() const {
  const json& value = value_at(value_);
  if (!value.is_number()) throw unexpected("a number");
  const auto number = value.get<double>();
  if (!std::isfinite(number)) throw error("expected a finite number");
  return number;
}

double JsonReader::number(double lowest, double highest) const {
  const double value = number();
  if (value >= lowest && value <= highest) return value;
  throw error(fmt::format("expected a number from {} to {}, found {}", lowest, highest, value));
}

int JsonReader::integer(int lowest, int highest) const {
  const double value = number();
  if (value == std::floor(value) && value >= lowest && value <= highest) return static_cast<int>(value);
  throw error(fmt::format("expected a whole number from {} to {}, found {}", lowest, highest, value));
}

std::int64_t JsonReader::big_integer() const {
  const json& value = value_at(value_);
  if (value.is_number_unsigned() && value.get<std::uint64_t>() > std::numeric_limits<std::int64_t>::max())
    throw error("expected a whole number of 64 bit");
  if (!value.is_number_integer()) throw unexpected("a whole number");
  return value.get<std::int64_t>();
}

std::vector<double> JsonReader::numbers() const {
  std::vector<double> numbers;
  for (const JsonReader& item : items()) numbers.push_back(item.number());
  return numbers;
}

Eigen::Vector3d JsonReader::vector() const {
  const auto numbers = this->numbers();
  if (numbers.size() != 3) throw error(fmt::format("expected 3 numbers, found {}", numbers.size()));
  return {numbers[0], numbers[1], numbers[2]};
}

Eigen::Vector3d JsonReader::unit_vector() const {
  const Eigen::Vector3d vector = this->vector();
  const double length = vector.norm();
  if (!(std::abs(length - 1) <= unit_length_tolerance))
    throw error(fmt::format("expected a vector of length 1, found length {}: divide it by its length", length));
  return std::abs(length - 1) <= rounding ? vector : Eigen::Vector3d(vector / length);
}

Eigen::Matrix3d JsonReader::rotation() const {
  const auto numbers = this->numbers();
  if (numbers.size() != 9)
    throw error(fmt::format("expected the 9 numbers of a row-major 3x3 matrix, found {}", numbers.size()));
  return exact_rotation(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(numbers.data()), *this);
}

Eigen::Matrix3d exact_rotation(Eigen::Matrix3d matrix, const JsonReader& where) {
  const auto deviation = [&] {
    return (matrix.transpose() * matrix - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  };
  if (!(deviation() <= rotation_tolerance))
    throw where.error(
        fmt::format("expected a rotation matrix, found one with |R^T R - I| = {:.3g} (at most {:g} is "
                    "rounding): its rows must have length 1 and be perpendicular",
                    deviation(), rotation_tolerance));
  if (matrix.determinant() < 0)
    throw where.error("expected a rotation matrix, found a reflection (determinant -1): all axes must be right-handed");
  // Newton's iteration to the nearest orthogonal matrix: doubles the correct digits each time.
  for (int i = 0; i < 3 && deviation() > rounding; ++i)
    matrix = (1.5 * matrix - 0.5 * matrix * matrix.transpose() * matrix).eval();
  return matrix;
}

}  // namespace pagesweep
