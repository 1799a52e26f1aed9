// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pagesweep/base/error.h"

namespace pagesweep {

/// One value of a JSON file that knows its file and its place in it, so that whatever is wrong with it becomes an Error
/// like "rig.json: cameras[1].fx: expected a number, found a string". Fields that nobody asks for are ignored.
class JsonReader {
 public:
  /// The root value of a file.
  /// \throws Error  if the file cannot be read or is no JSON
  static JsonReader read(const std::filesystem::path& file);
  /// The root value of a text; `file` serves the messages only.
  static JsonReader parse(std::string_view text, const std::filesystem::path& file);

  const std::filesystem::path& file() const;
  /// "cameras[1].fx"; empty for the root.
  const std::string& place() const { return place_; }

  /// All below throw Error if the value is not what is asked for.
  /// Checks the fields "format" and "version" of a root value.
  void expect_format(std::string_view format, int version) const;
  JsonReader at(std::string_view name) const;                   ///< the field of that name
  std::optional<JsonReader> find(std::string_view name) const;  ///< likewise; nothing if it is absent or null
  std::vector<JsonReader> items() const;                        ///< of an array
  std::vector<std::string> names() const;                       ///< of an object's fields, in alphabetical order
  bool is_object() const;
  bool is_null() const;
  bool is_array() const;  ///< where a field may be one or several
  std::string text() const;
  bool boolean() const;
  int integer(int lowest, int highest) const;
  std::int64_t big_integer() const;                    ///< of 64 bit
  double number() const;                               ///< finite
  double number(double lowest, double highest) const;  ///< within these, both included
  std::vector<double> numbers() const;                 ///< an array of finite numbers
  Eigen::Vector3d vector() const;                      ///< an array of three
  Eigen::Vector3d unit_vector() const;                 ///< likewise, of length 1 within 1e-4; it is made exact
  Eigen::Matrix3d rotation() const;                    ///< row-major, see exact_rotation()

  /// An error about this value, for checks of the caller's own.
  Error error(const std::string& problem) const;

 private:
  struct Document;
  JsonReader(std::shared_ptr<const Document> document, const void* value, std::string place);
  /// "expected a number, found a string"
  Error unexpected(std::string_view expected) const;

  std::shared_ptr<const Document> document_;
  const void* value_;  ///< nlohmann::json in document_, which stays out of this header
  std::string place_;
};

/// The nearest rotation matrix, if that is what a matrix is meant to be: orthogonal within 1e-4 and right-handed. One
/// that is exact to double precision is kept to the last bit.
/// \throws Error  about `where` it stands, otherwise
Eigen::Matrix3d exact_rotation(Eigen::Matrix3d matrix, const JsonReader& where);

}  // namespace pagesweep
