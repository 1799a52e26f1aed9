// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/capture_tags.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <string_view>

namespace pagesweep {
namespace {

constexpr std::string_view signature("Exif\0\0", 6);
constexpr std::uint16_t ascii_type = 2, exif_directory_tag = 0x8769, date_time_original_tag = 0x9003;

struct Field {
  std::uint16_t tag;
  std::string CaptureTags::* member;
};
constexpr std::array<Field, 7> fields = {{{270, &CaptureTags::description},
                                          {271, &CaptureTags::make},
                                          {272, &CaptureTags::model},
                                          {305, &CaptureTags::software},
                                          {306, &CaptureTags::date_time},
                                          {315, &CaptureTags::artist},
                                          {33432, &CaptureTags::copyright}}};

/// The TIFF structure inside an EXIF blob; reads nothing beyond its end.
class ExifReader {
 public:
  explicit ExifReader(std::string_view tiff) : tiff_(tiff), little_(tiff.starts_with("II")) {}

  std::uint32_t number(std::size_t at, std::size_t bytes) const {
    if (at > tiff_.size() || bytes > tiff_.size() - at) return 0;
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < bytes; ++i)
      value = value << 8 | static_cast<unsigned char>(tiff_[at + (little_ ? bytes - 1 - i : i)]);
    return value;
  }
  /// Calls visit(tag, place of its entry) for the entries of a directory.
  template <class Visit>
  void for_each_entry(std::size_t directory, Visit&& visit) const {
    const std::uint32_t count = number(directory, 2);
    for (std::uint32_t i = 0; i < count && directory + 14 + 12 * i <= tiff_.size(); ++i)
      visit(static_cast<std::uint16_t>(number(directory + 2 + 12 * i, 2)), directory + 2 + 12 * i);
  }
  /// The text of an entry without the zeros and blanks at its end.
  std::string text(std::size_t entry) const {
    const std::size_t length = number(entry + 4, 4);
    const std::size_t at = length <= 4 ? entry + 8 : number(entry + 8, 4);
    if (number(entry + 2, 2) != ascii_type || at > tiff_.size() || length > tiff_.size() - at) return "";
    const std::string_view text = tiff_.substr(at, std::min(length, tiff_.substr(at, length).find('\0')));
    return std::string(text.substr(0, text.find_last_not_of(' ') + 1));
  }

 private:
  std::string_view tiff_;
  bool little_;
};

std::string little_endian(std::uint32_t value, int bytes) {
  std::string text;
  for (int i = 0; i < bytes; ++i) text += static_cast<char>(value >> (8 * i) & 0xFF);
  return text;
}

}  // namespace

bool CaptureTags::empty() const {
  return std::ranges::all_of(fields, [&](const Field& field) { return (this->*field.member).empty(); });
}

CaptureTags read_exif(std::span<const std::byte> exif) {
  CaptureTags tags;
  std::string_view blob(reinterpret_cast<const char*>(exif.data()), exif.size());
  if (blob.starts_with(signature)) blob.remove_prefix(signature.size());
  if (!blob.starts_with("II") && !blob.starts_with("MM")) return tags;
  const ExifReader reader(blob);
  std::size_t exif_directory = 0;
  reader.for_each_entry(reader.number(4, 4), [&](std::uint16_t tag, std::size_t entry) {
    for (const Field& field : fields)
      if (tag == field.tag) tags.*field.member = reader.text(entry);
    if (tag == exif_directory_tag) exif_directory = reader.number(entry + 8, 4);
  });
  if (exif_directory > 0)
    reader.for_each_entry(exif_directory, [&](std::uint16_t tag, std::size_t entry) {
      if (tag == date_time_original_tag && !reader.text(entry).empty()) tags.date_time = reader.text(entry);
    });
  return tags;
}

std::vector<std::byte> make_exif(const CaptureTags& tags) {
  std::string entries, texts;
  std::uint32_t count = 0;
  for (const Field& field : fields) count += !(tags.*field.member).empty();
  const std::uint32_t texts_at = 8 + 2 + 12 * count + 4;
  for (const Field& field : fields) {
    const std::string text = (tags.*field.member) + '\0';
    if (text.size() == 1) continue;
    entries += little_endian(field.tag, 2) + little_endian(ascii_type, 2);
    entries += little_endian(static_cast<std::uint32_t>(text.size()), 4);
    if (text.size() <= 4) {
      entries += text + std::string(4 - text.size(), '\0');
    } else {
      entries += little_endian(texts_at + static_cast<std::uint32_t>(texts.size()), 4);
      texts += text + std::string(text.size() % 2, '\0');
    }
  }
  std::string blob(signature);
  blob += std::string("II*\0\x08\0\0\0", 8) + little_endian(count, 2) + entries + little_endian(0, 4) + texts;
  const auto bytes = std::as_bytes(std::span(blob));
  return {bytes.begin(), bytes.end()};
}

std::string iso_date(const std::string& exif_date) {
  constexpr std::string_view form = "dddd:dd:dd dd:dd:dd";
  if (exif_date.size() < form.size()) return "";
  for (std::size_t i = 0; i < form.size(); ++i) {
    const auto c = static_cast<unsigned char>(exif_date[i]);
    if (form[i] == 'd' ? !std::isdigit(c) : form[i] != exif_date[i]) return "";
  }
  std::string date = exif_date.substr(0, form.size());
  date[4] = date[7] = '-';
  date[10] = 'T';
  return date;
}

}  // namespace pagesweep
