// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/jp2_header_internal.h"

#include <cmath>
#include <cstdint>
#include <optional>

namespace pagesweep {
namespace {

constexpr std::size_t box_header = 8;  // length, including itself, and type
constexpr char icc_method = 2;         // of a colour specification
constexpr std::string_view xmp_uuid("\xBE\x7A\xCF\xCB\x97\xA9\x42\xE8\x9C\x71\x99\x94\x91\xE3\xAF\xAC", 16);

std::string text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::vector<std::byte> bytes_of(std::string_view text) {
  const auto* begin = reinterpret_cast<const std::byte*>(text.data());
  return {begin, begin + text.size()};
}

std::uint32_t big_endian(std::string_view bytes, std::size_t at, int count) {
  std::uint32_t value = 0;
  for (int i = 0; i < count; ++i)
    value = value << 8 | static_cast<unsigned char>(bytes[at + static_cast<std::size_t>(i)]);
  return value;
}

std::string to_big_endian(std::uint32_t value, int count) {
  std::string bytes;
  for (int i = count - 1; i >= 0; --i) bytes.push_back(static_cast<char>(value >> (8 * i) & 0xff));
  return bytes;
}

struct Box {
  std::size_t begin = 0;  ///< of its header
  std::string_view content;
};

/// The box of that type among those that `boxes` is a row of. Boxes with extended length hold pictures, not headers.
std::optional<Box> find_box(std::string_view boxes, std::string_view type) {
  for (std::size_t at = 0; at + box_header <= boxes.size();) {
    const std::uint32_t length = big_endian(boxes, at, 4);
    if (length < box_header || length > boxes.size() - at) return std::nullopt;
    if (boxes.substr(at + 4, 4) == type) return Box{at, boxes.substr(at + box_header, length - box_header)};
    at += length;
  }
  return std::nullopt;
}

/// A resolution as the file stores it: numerator / denominator 10^exponent pixels a metre.
struct Ratio {
  std::uint32_t numerator = 1, denominator = 1;
  int exponent = 0;
};

/// The closest ratio with 16-bit parts.
Ratio ratio_of(double pixels_per_m) {
  const int exponent = static_cast<int>(std::floor(std::log10(pixels_per_m)));
  const double mantissa = pixels_per_m / std::pow(10.0, exponent);  // 1 to 10
  Ratio best{static_cast<std::uint32_t>(std::lround(mantissa)), 1, exponent};
  double least_error = std::abs(best.numerator - mantissa);
  for (std::uint32_t denominator = 2; denominator <= 6000; ++denominator) {
    const double numerator = std::round(mantissa * denominator);
    const double error = std::abs(numerator / denominator - mantissa);
    if (error >= least_error) continue;
    least_error = error;
    best = {static_cast<std::uint32_t>(numerator), denominator, exponent};
  }
  return best;
}

std::string box(std::string_view type, std::string_view content) {
  return to_big_endian(static_cast<std::uint32_t>(box_header + content.size()), 4).append(type).append(content);
}

std::string resolution_box(double pixels_per_mm) {
  const Ratio ratio = ratio_of(1000 * pixels_per_mm);
  const std::string fraction = to_big_endian(ratio.numerator, 2) + to_big_endian(ratio.denominator, 2);
  const std::string exponent(1, static_cast<char>(ratio.exponent));
  return box("res ", box("resc", fraction + fraction + exponent + exponent));
}

}  // namespace

std::string complete_jp2_header(std::string jp2, double pixels_per_mm, std::span<const std::byte> icc_profile,
                                std::span<const std::byte> xmp) {
  const auto header = find_box(jp2, "jp2h");
  if (!header) return jp2;
  std::string content(header->content);
  if (!icc_profile.empty()) {
    if (const auto color = find_box(content, "colr")) content.erase(color->begin, box_header + color->content.size());
    const std::string method_precedence_approximation = {icc_method, 0, 0};
    content += box("colr", method_precedence_approximation + text_of(icc_profile));
  }
  if (pixels_per_mm > 1e-3 && pixels_per_mm < 1e6) content += resolution_box(pixels_per_mm);
  std::string boxes = box("jp2h", content);
  if (!xmp.empty()) boxes += box("uuid", std::string(xmp_uuid) + text_of(xmp));
  return jp2.replace(header->begin, box_header + header->content.size(), boxes);
}

Jp2Header read_jp2_header(std::string_view jp2) {
  Jp2Header found;
  const auto header = find_box(jp2, "jp2h");
  if (!header) return found;
  const auto color = find_box(header->content, "colr");
  if (color && color->content.size() > 3 && color->content[0] == icc_method)
    found.icc_profile = bytes_of(color->content.substr(3));
  const auto uuid = find_box(jp2, "uuid");
  if (uuid && uuid->content.starts_with(xmp_uuid)) found.xmp = bytes_of(uuid->content.substr(xmp_uuid.size()));
  const auto resolution = find_box(header->content, "res ");
  if (!resolution) return found;
  auto values = find_box(resolution->content, "resc");
  if (!values) values = find_box(resolution->content, "resd");
  if (!values || values->content.size() < 10) return found;
  // Down, then across: numerator and denominator each; then their exponents.
  const double denominator = big_endian(values->content, 6, 2);
  const auto exponent = static_cast<signed char>(values->content[9]);
  if (denominator > 0)
    found.pixels_per_mm = big_endian(values->content, 4, 2) / denominator * std::pow(10.0, exponent) / 1000;
  return found;
}

}  // namespace pagesweep
