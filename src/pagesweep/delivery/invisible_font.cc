// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cstdint>
#include <vector>

#include "pagesweep/delivery/invisible_font_internal.h"

namespace pagesweep {
namespace {

constexpr int units_per_em = 1000;
constexpr int width_units = static_cast<int>(InvisibleFont::glyph_width * units_per_em);
constexpr int ascent_units = static_cast<int>(InvisibleFont::ascent * units_per_em);
constexpr int descent_units = static_cast<int>(InvisibleFont::descent * units_per_em);
constexpr const char* name = "PagesweepInvisible";

std::string big_endian(std::uint32_t value, int bytes) {
  std::string text;
  for (int i = bytes - 1; i >= 0; --i) text += static_cast<char>(value >> (8 * i) & 0xFF);
  return text;
}

/// 16-bit numbers in a row.
std::string words(std::initializer_list<int> values) {
  std::string text;
  for (const int value : values) text += big_endian(static_cast<std::uint32_t>(value) & 0xFFFF, 2);
  return text;
}

std::uint32_t checksum(std::string_view table) {
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < table.size(); i += 4)
    for (std::size_t k = 0; k < 4; ++k)
      sum += i + k < table.size() ? static_cast<std::uint32_t>(static_cast<unsigned char>(table[i + k])) << (24 - 8 * k)
                                  : 0;
  return sum;
}

struct Table {
  std::string_view tag;
  std::string data;
};

/// The tables of a TrueType font (ISO/IEC 14496-22) of two glyphs without outlines; glyph 1 stands for all characters.
std::vector<Table> font_tables() {
  const std::string long_zero(8, '\0');
  const std::string head = words({1, 0, 1, 0}) + std::string(4, '\0') + big_endian(0x5F0F3CF5, 4) +
                           words({0, units_per_em}) + long_zero + long_zero +
                           words({0, -descent_units, width_units, ascent_units, 0, 8, 2, 0, 0});
  const std::string hhea =
      words({1, 0, ascent_units, -descent_units, 0, width_units, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 2});
  const std::string maxp = words({1, 0, 2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0});
  return {
      {"glyf", std::string(4, '\0')}, {"head", head}, {"hhea", hhea}, {"hmtx", words({width_units, 0, width_units, 0})},
      {"loca", words({0, 0, 0})},     {"maxp", maxp}};
}

std::string make_font() {
  constexpr std::size_t adjustment_in_head = 8;
  const std::vector<Table> tables = font_tables();
  const auto count = static_cast<int>(tables.size());
  std::string directory = big_endian(0x00010000, 4) + words({count, 64, 2, 16 * count - 64});
  std::string data;
  std::size_t head_at = 0;
  const std::size_t data_at = 12 + 16 * tables.size();
  for (const Table& table : tables) {
    if (table.tag == "head") head_at = data_at + data.size();
    directory += std::string(table.tag) + big_endian(checksum(table.data), 4);
    directory += big_endian(static_cast<std::uint32_t>(data_at + data.size()), 4);
    directory += big_endian(static_cast<std::uint32_t>(table.data.size()), 4);
    data += table.data + std::string((4 - table.data.size() % 4) % 4, '\0');
  }
  std::string font = directory + data;
  return font.replace(head_at + adjustment_in_head, 4, big_endian(0xB1B0AFBAU - checksum(font), 4));
}

}  // namespace

std::string InvisibleFont::codes_of(std::string_view utf8) {
  constexpr std::size_t most_codes = 65'000;
  std::string digits;
  for (const char32_t character : decode_utf8(utf8)) {
    if (codes_.size() >= most_codes && !codes_.contains(character)) continue;
    const auto [entry, is_new] = codes_.try_emplace(character, static_cast<int>(codes_.size()) + 1);
    digits += fmt::format("{:04X}", entry->second);
  }
  return digits;
}

std::string InvisibleFont::to_unicode() const {
  constexpr std::size_t most_in_a_row = 100;
  std::string map =
      "/CIDInit /ProcSet findresource begin\n12 dict begin\nbegincmap\n"
      "/CIDSystemInfo << /Registry (Adobe) /Ordering (UCS) /Supplement 0 >> def\n"
      "/CMapName /Adobe-Identity-UCS def\n/CMapType 2 def\n"
      "1 begincodespacerange\n<0000> <FFFF>\nendcodespacerange\n";
  std::map<int, char32_t> characters;
  for (const auto& [character, code] : codes_) characters[code] = character;
  for (auto entry = characters.begin(); entry != characters.end();) {
    const auto left = static_cast<std::size_t>(std::distance(entry, characters.end()));
    const std::size_t row = std::min(left, most_in_a_row);
    map += fmt::format("{} beginbfchar\n", row);
    for (std::size_t i = 0; i < row; ++i, ++entry)
      map += fmt::format("<{:04X}> {}\n", entry->first, pdf_hex(encode_utf16(entry->second)));
    map += "endbfchar\n";
  }
  return map + "endcmap\nCMapName currentdict /CMap defineresource pop\nend\nend\n";
}

void InvisibleFont::write(PdfWriter& pdf, int object) const {
  const int font = pdf.reserve(), descriptor = pdf.reserve(), file = pdf.reserve(), glyphs = pdf.reserve(),
            unicode = pdf.reserve();
  pdf.write(object, fmt::format("<< /Type /Font /Subtype /Type0 /BaseFont /{} /Encoding /Identity-H "
                                "/DescendantFonts [{}] /ToUnicode {} >>",
                                name, pdf_reference(font), pdf_reference(unicode)));
  pdf.write(font, fmt::format("<< /Type /Font /Subtype /CIDFontType2 /BaseFont /{} /CIDSystemInfo << /Registry (Adobe) "
                              "/Ordering (Identity) /Supplement 0 >> /FontDescriptor {} /DW {} /CIDToGIDMap {} >>",
                              name, pdf_reference(descriptor), width_units, pdf_reference(glyphs)));
  pdf.write(descriptor,
            fmt::format("<< /Type /FontDescriptor /FontName /{} /Flags 4 /FontBBox [0 {} {} {}] /ItalicAngle 0 "
                        "/Ascent {} /Descent {} /CapHeight {} /StemV 80 /FontFile2 {} >>",
                        name, -descent_units, width_units, ascent_units, ascent_units, -descent_units, ascent_units,
                        pdf_reference(file)));
  const std::string font_file = make_font();
  pdf.write_packed_stream(file, fmt::format("/Length1 {}", font_file.size()), font_file);
  std::string map = words({0});
  for (std::size_t i = 0; i < codes_.size(); ++i) map += words({1});
  pdf.write_packed_stream(glyphs, "", map);
  pdf.write_packed_stream(unicode, "", to_unicode());
}

}  // namespace pagesweep
