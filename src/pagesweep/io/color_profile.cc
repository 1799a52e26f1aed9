// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/color_profile.h"

#include <cmath>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>

namespace pagesweep {
namespace {

/// Bytes in the order of an ICC profile: big-endian.
class Bytes {
 public:
  Bytes& text(std::string_view letters) {
    bytes_ += letters;
    return *this;
  }
  Bytes& number(std::uint32_t value) {
    for (int shift = 24; shift >= 0; shift -= 8) bytes_ += static_cast<char>(value >> shift & 0xFF);
    return *this;
  }
  Bytes& half(long value) {
    bytes_ += static_cast<char>(value >> 8 & 0xFF);
    bytes_ += static_cast<char>(value & 0xFF);
    return *this;
  }
  /// s15Fixed16Number
  Bytes& fixed(double value) { return number(static_cast<std::uint32_t>(std::lround(value * 65536))); }
  Bytes& append(const Bytes& other) { return text(other.bytes_); }
  Bytes& zeros(std::size_t count) {
    bytes_.append(count, '\0');
    return *this;
  }
  Bytes& pad(std::size_t multiple) { return zeros((multiple - bytes_.size() % multiple) % multiple); }
  const std::string& get() const { return bytes_; }
  std::size_t size() const { return bytes_.size(); }

 private:
  std::string bytes_;
};

/// textDescriptionType: the text in ASCII, and none in Unicode and in the Macintosh's script code.
Bytes description(std::string_view text) {
  Bytes tag;
  tag.text("desc").number(0).number(static_cast<std::uint32_t>(text.size() + 1)).text(text);
  return tag.zeros(1 + 4 + 4 + 2 + 1 + 67).pad(4);
}

Bytes plain_text(std::string_view text) { return Bytes().text("text").number(0).text(text).zeros(1).pad(4); }

Bytes xyz(double x, double y, double z) { return Bytes().text("XYZ ").number(0).fixed(x).fixed(y).fixed(z); }

struct Tag {
  std::string_view name;
  Bytes data;
};

/// curveType: light over sample, at 1024 samples: ((x + 0.055) / 1.055)^2.4, below 0.04045 x / 12.92.
Bytes srgb_curve() {
  constexpr int samples = 1024;
  Bytes curve;
  curve.text("curv").number(0).number(samples);
  for (int i = 0; i < samples; ++i) {
    const double x = static_cast<double>(i) / (samples - 1);
    curve.half(std::lround(65535 * (x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4))));
  }
  return curve;
}

/// The tags of a matrix profile. Primaries and white are those of sRGB, adapted to D50 by Bradford's matrix.
std::vector<Tag> srgb_tags() {
  const Bytes curve = srgb_curve();
  return {{"desc", description("sRGB")},
          {"cprt", plain_text("No copyright, use freely")},
          {"wtpt", xyz(0.9642, 1.0, 0.8249)},
          {"rXYZ", xyz(0.43607, 0.22249, 0.01392)},
          {"gXYZ", xyz(0.38515, 0.71687, 0.09708)},
          {"bXYZ", xyz(0.14307, 0.06061, 0.71410)},
          {"rTRC", curve},
          {"gTRC", curve},
          {"bTRC", curve}};
}

std::vector<Tag> gray_tags() {
  return {{"desc", description("Gray with the tone curve of sRGB")},
          {"cprt", plain_text("No copyright, use freely")},
          {"wtpt", xyz(0.9642, 1.0, 0.8249)},
          {"kTRC", srgb_curve()}};
}

/// \param space  signature of the device's colours: "RGB ", "GRAY"
std::vector<std::byte> make_profile(std::string_view space, const std::vector<Tag>& tags) {
  Bytes table, data;
  const std::size_t data_start = 128 + 4 + 12 * tags.size();
  table.number(static_cast<std::uint32_t>(tags.size()));
  std::map<std::string, std::size_t> places;  // tags with the same data share them
  for (const Tag& tag : tags) {
    const auto [place, is_new] = places.try_emplace(tag.data.get(), data_start + data.size());
    if (is_new) data.append(tag.data).pad(4);
    table.text(tag.name).number(static_cast<std::uint32_t>(place->second));
    table.number(static_cast<std::uint32_t>(tag.data.size()));
  }
  Bytes profile;
  profile.number(static_cast<std::uint32_t>(data_start + data.size())).zeros(4).number(0x02100000);
  profile.text("mntr").text(space).text("XYZ ").number(2024u << 16 | 1).number(1u << 16).number(0).text("acsp");
  profile.zeros(28).fixed(0.9642).fixed(1.0).fixed(0.8249).zeros(48);
  const std::string bytes = profile.append(table).append(data).get();
  const auto span = std::as_bytes(std::span(bytes));
  return {span.begin(), span.end()};
}

}  // namespace

std::vector<std::byte> make_srgb_profile() { return make_profile("RGB ", srgb_tags()); }

std::vector<std::byte> make_gray_profile() { return make_profile("GRAY", gray_tags()); }

bool fits_profile(const Picture& picture) {
  constexpr std::size_t header = 128, space_at = 16;
  if (picture.icc_profile.size() < header) return false;
  const std::string_view space(reinterpret_cast<const char*>(picture.icc_profile.data()) + space_at, 4);
  return space == (picture.channels == 1 ? "GRAY" : "RGB ");
}

void complete_profile(Picture& picture) {
  if (!fits_profile(picture)) picture.icc_profile = picture.channels == 1 ? make_gray_profile() : make_srgb_profile();
}

}  // namespace pagesweep
