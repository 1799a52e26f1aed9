// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/ply_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

#include "pagesweep/base/error.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/words_internal.h"

namespace pagesweep {
namespace {

static_assert(std::endian::native == std::endian::little, "write_ply writes the machine's own byte order");

constexpr std::size_t most_bytes = std::size_t{1} << 34;

/// One point in our files: eight floats and a byte.
constexpr std::size_t record_bytes = 8 * sizeof(float) + 1;
constexpr std::array<std::string_view, 9> property_names = {"x",  "y",         "z",     "nx",    "ny",
                                                            "nz", "intensity", "sigma", "camera"};

enum class PlyType { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

std::optional<PlyType> type_named(std::string_view name) {
  constexpr std::array<std::array<std::string_view, 2>, 8> names = {{{"char", "int8"},
                                                                     {"uchar", "uint8"},
                                                                     {"short", "int16"},
                                                                     {"ushort", "uint16"},
                                                                     {"int", "int32"},
                                                                     {"uint", "uint32"},
                                                                     {"float", "float32"},
                                                                     {"double", "float64"}}};
  for (std::size_t i = 0; i < names.size(); ++i)
    if (name == names[i][0] || name == names[i][1]) return static_cast<PlyType>(i);
  return std::nullopt;
}

struct Property {
  PlyType type = PlyType::float32;
  std::optional<PlyType> list_count;  ///< a list: its length, then so many values
  int column = -1;                    ///< in property_names; -1: not ours
};

struct Element {
  std::string name;
  std::size_t count = 0;
  std::vector<Property> properties;
};

enum class PlyFormat { ascii, little_endian, big_endian };

struct Header {
  PlyFormat format = PlyFormat::ascii;
  std::vector<Element> elements;
  std::size_t bytes = 0;
};

/// Reads a PLY's header line by line.
class HeaderReader {
 public:
  HeaderReader(std::string_view text, const std::filesystem::path& file) : text_(text), file_(file) {}

  Header read() {
    if (next_line() != std::vector<std::string_view>{"ply"}) throw error("expected \"ply\": this is no PLY file");
    for (auto words = next_line(); words != std::vector<std::string_view>{"end_header"}; words = next_line()) {
      if (words.empty() || words[0] == "comment" || words[0] == "obj_info") continue;
      if (words[0] == "format" && words.size() >= 2)
        read_format(words[1]);
      else if (words[0] == "element" && words.size() == 3)
        read_element(words);
      else if (words[0] == "property" && (words.size() == 3 || (words.size() == 5 && words[1] == "list")))
        read_property(words);
      else
        throw error("expected format, element, property, comment or end_header");
    }
    if (!has_format_) throw error("expected a line \"format ...\" in the header");
    header_.bytes = consumed_;
    return std::move(header_);
  }

 private:
  std::vector<std::string_view> next_line() {
    ++line_;
    const auto end = text_.find('\n', consumed_);
    if (end == std::string_view::npos) throw error("expected \"end_header\", found the file's end");
    const auto line = text_.substr(consumed_, end - consumed_);
    consumed_ = end + 1;
    return words_of(line);
  }

  void read_format(std::string_view name) {
    if (name == "ascii")
      header_.format = PlyFormat::ascii;
    else if (name == "binary_little_endian")
      header_.format = PlyFormat::little_endian;
    else if (name == "binary_big_endian")
      header_.format = PlyFormat::big_endian;
    else
      throw error("expected the format ascii, binary_little_endian or binary_big_endian");
    has_format_ = true;
  }

  void read_element(const std::vector<std::string_view>& words) {
    Element element{std::string(words[1]), 0, {}};
    const auto [end, failed] = std::from_chars(words[2].data(), words[2].data() + words[2].size(), element.count);
    if (failed != std::errc() || end != words[2].data() + words[2].size())
      throw error("expected the number of elements");
    header_.elements.push_back(std::move(element));
  }

  void read_property(const std::vector<std::string_view>& words) {
    if (header_.elements.empty()) throw error("expected an element before its properties");
    Property property;
    const bool is_list = words.size() == 5;
    const auto type = type_named(words[is_list ? 3 : 1]);
    const auto count_type = is_list ? type_named(words[2]) : PlyType::uint8;
    if (!type || !count_type) throw error("expected a type of a property, such as float or uchar");
    property.type = *type;
    if (is_list) property.list_count = count_type;
    const auto name = std::ranges::find(property_names, words.back());
    if (!is_list && name != property_names.end()) property.column = static_cast<int>(name - property_names.begin());
    header_.elements.back().properties.push_back(property);
  }

  Error error(const std::string& problem) const { return bad_input(file_, fmt::format("line {}", line_), problem); }

  std::string_view text_;
  const std::filesystem::path& file_;
  Header header_;
  bool has_format_ = false;
  std::size_t consumed_ = 0;
  int line_ = 0;
};

/// Takes one value after the other out of a PLY's body.
class BodyReader {
 public:
  BodyReader(std::string_view body, PlyFormat format, const std::filesystem::path& file)
      : body_(body), format_(format), file_(file) {}

  double value(PlyType type) { return format_ == PlyFormat::ascii ? ascii_value() : binary_value(type); }

  void skip_list(const Property& list) {
    const double count = value(*list.list_count);
    if (!(count >= 0 && count <= static_cast<double>(body_.size()))) throw cut_short();
    for (auto i = static_cast<std::size_t>(count); i > 0; --i) value(list.type);
  }

  Error cut_short() const { return cannot_read(file_, "it is cut short: the header announces more values"); }

 private:
  double ascii_value() {
    const auto begin = body_.find_first_not_of(" \t\r\n");
    if (begin == std::string_view::npos) throw cut_short();
    body_.remove_prefix(begin);
    const auto word = body_.substr(0, std::min(body_.find_first_of(" \t\r\n"), body_.size()));
    body_.remove_prefix(word.size());
    const auto number = number_in(word);
    if (!number) throw bad_input(file_, "", fmt::format("expected a number, found \"{}\"", word.substr(0, 40)));
    return *number;
  }

  double binary_value(PlyType type) {
    switch (type) {
      case PlyType::int8:
        return take<std::int8_t>();
      case PlyType::uint8:
        return take<std::uint8_t>();
      case PlyType::int16:
        return take<std::int16_t>();
      case PlyType::uint16:
        return take<std::uint16_t>();
      case PlyType::int32:
        return take<std::int32_t>();
      case PlyType::uint32:
        return take<std::uint32_t>();
      case PlyType::float32:
        return take<float>();
      default:
        return take<double>();
    }
  }

  template <class T>
  T take() {
    if (body_.size() < sizeof(T)) throw cut_short();
    std::array<char, sizeof(T)> bytes;
    std::memcpy(bytes.data(), body_.data(), sizeof(T));
    body_.remove_prefix(sizeof(T));
    if (format_ == PlyFormat::big_endian) std::ranges::reverse(bytes);
    return std::bit_cast<T>(bytes);
  }

  std::string_view body_;
  PlyFormat format_;
  const std::filesystem::path& file_;
};

void require_coordinates(const Element& vertices, const std::filesystem::path& file) {
  for (int column = 0; column < 3; ++column)
    if (std::ranges::none_of(vertices.properties, [&](const Property& p) { return p.column == column; }))
      throw bad_input(file, "element vertex",
                      fmt::format("expected a property {}", property_names[static_cast<std::size_t>(column)]));
}

void append(PointCloud& cloud, const std::array<double, 9>& v) {
  const auto vector = [&](std::size_t i) {
    return Eigen::Vector3f(static_cast<float>(v[i]), static_cast<float>(v[i + 1]), static_cast<float>(v[i + 2]));
  };
  cloud.points.push_back(vector(0));
  cloud.normals.push_back(vector(3));
  cloud.intensity.push_back(static_cast<float>(v[6]));
  cloud.sigma.push_back(static_cast<float>(v[7]));
  cloud.camera.push_back(v[8] >= 0 && v[8] <= 255 ? static_cast<std::uint8_t>(v[8]) : 0);
}

/// The values of one element in the order of property_names; NaN where it has none.
std::array<double, 9> read_element(BodyReader& body, const Element& element) {
  std::array<double, 9> values;
  values.fill(std::numeric_limits<double>::quiet_NaN());
  for (const Property& property : element.properties) {
    if (property.list_count) {
      body.skip_list(property);
      continue;
    }
    const double value = body.value(property.type);
    if (property.column >= 0) values[static_cast<std::size_t>(property.column)] = value;
  }
  return values;
}

std::string header_of(std::size_t points) {
  std::string header = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment millimetres, rig frame; sigma along the viewing ray; camera 1 is "
      "the "
      "rig's first\nelement vertex {}\n",
      points);
  for (std::size_t i = 0; i < property_names.size(); ++i)
    header += fmt::format("property {} {}\n", i < 8 ? "float" : "uchar", property_names[i]);
  return header + "end_header\n";
}

}  // namespace

PointCloud gather_points(std::span<const PointMap> cameras) {
  PointCloud cloud;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const PointMap& map = cameras[c];
    for (std::size_t i = 0; i < map.status.size(); ++i) {
      if (map.status.data()[i] != PixelStatus::ok) continue;
      cloud.points.emplace_back(map.x.data()[i], map.y.data()[i], map.z.data()[i]);
      cloud.normals.emplace_back(map.nx.data()[i], map.ny.data()[i], map.nz.data()[i]);
      cloud.intensity.push_back(map.intensity.data()[i]);
      cloud.sigma.push_back(map.sigma.data()[i]);
      cloud.camera.push_back(static_cast<std::uint8_t>(c + 1));
    }
  }
  return cloud;
}

void write_ply(const std::filesystem::path& file, const PointCloud& cloud) {
  const std::size_t count = cloud.size();
  for (const std::size_t size : {cloud.normals.size(), cloud.intensity.size(), cloud.sigma.size(), cloud.camera.size()})
    if (size != count) throw std::invalid_argument("write_ply: the lengths of the point cloud's vectors differ");
  std::string bytes = header_of(count);
  std::size_t end = bytes.size();
  bytes.resize(end + count * record_bytes);
  for (std::size_t i = 0; i < count; ++i, end += record_bytes) {
    const Eigen::Vector3f &p = cloud.points[i], &n = cloud.normals[i];
    const std::array<float, 8> values = {p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), cloud.intensity[i], cloud.sigma[i]};
    std::memcpy(bytes.data() + end, values.data(), sizeof(values));
    bytes[end + sizeof(values)] = static_cast<char>(cloud.camera[i]);
  }
  write_bytes(file, bytes);
}

void write_ply(const std::filesystem::path& file, std::span<const PointMap> cameras) {
  write_ply(file, gather_points(cameras));
}

PointCloud read_ply(const std::filesystem::path& file) {
  const std::string text = read_bytes(file, most_bytes);
  const Header header = HeaderReader(text, file).read();
  BodyReader body(std::string_view(text).substr(header.bytes), header.format, file);
  for (const Element& element : header.elements) {
    if (element.name == "vertex") {
      require_coordinates(element, file);
      PointCloud cloud;
      for (std::size_t i = 0; i < element.count; ++i) append(cloud, read_element(body, element));
      return cloud;
    }
    if (element.properties.empty()) continue;
    for (std::size_t i = 0; i < element.count; ++i) read_element(body, element);
  }
  throw bad_input(file, "", "expected an element vertex");
}

}  // namespace pagesweep
