// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <zlib.h>

#include <stdexcept>

#include "pagesweep/base/error.h"
#include "pagesweep/delivery/pdf_writer_internal.h"

namespace pagesweep {

std::string pdf_reference(int object) { return fmt::format("{} 0 R", object); }

std::string pdf_hex(std::string_view bytes) {
  std::string hex = "<";
  for (const char byte : bytes) hex += fmt::format("{:02X}", static_cast<unsigned char>(byte));
  return hex + ">";
}

std::string pdf_text(std::string_view utf8) {
  std::string text = "\xFE\xFF";
  for (const char32_t character : decode_utf8(utf8)) text += encode_utf16(character);
  return pdf_hex(text);
}

std::string encode_utf16(char32_t character) {
  const auto unit = [](char32_t value) {
    return std::string{static_cast<char>(value >> 8 & 0xFF), static_cast<char>(value & 0xFF)};
  };
  if (character < 0x10000) return unit(character);
  const char32_t rest = character - 0x10000;
  return unit(0xD800 | rest >> 10) + unit(0xDC00 | (rest & 0x3FF));
}

std::u32string decode_utf8(std::string_view text) {
  constexpr char32_t replacement = 0xFFFD, last = 0x10FFFF;
  std::u32string characters;
  for (std::size_t at = 0; at < text.size();) {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[at + i]); };
    const unsigned char first = byte(0);
    const std::size_t length = first < 0x80 ? 1 : first < 0xC2 ? 0 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : 4;
    char32_t value = length == 1 ? first : first & (0x7FU >> length);
    bool is_sound = length > 0 && at + length <= text.size();
    for (std::size_t i = 1; is_sound && i < length; ++i) {
      is_sound = (byte(i) & 0xC0) == 0x80;
      value = value << 6 | (byte(i) & 0x3FU);
    }
    const bool is_surrogate = value >= 0xD800 && value < 0xE000;
    is_sound = is_sound && value <= last && !is_surrogate;
    characters += is_sound ? value : replacement;
    at += is_sound ? length : 1;
  }
  return characters;
}

std::string deflate(std::string_view bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::string packed(size, '\0');
  const auto* source = reinterpret_cast<const Bytef*>(bytes.data());
  if (compress2(reinterpret_cast<Bytef*>(packed.data()), &size, source, static_cast<uLong>(bytes.size()), 6) != Z_OK)
    throw std::bad_alloc();
  packed.resize(size);
  return packed;
}

PdfWriter::PdfWriter(const std::filesystem::path& file) : file_(file), stream_(file, std::ios::binary) {
  if (!stream_) throw cannot_write(file, "it cannot be opened");
  put("%PDF-1.7\n%\xE2\xE3\xCF\xD3\n");  // bytes above 127: it is no text
}

void PdfWriter::put(std::string_view bytes) {
  stream_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!stream_) throw cannot_write(file_, "the disk may be full");
  at_ += bytes.size();
}

int PdfWriter::reserve() {
  places_.push_back(0);
  return static_cast<int>(places_.size());
}

void PdfWriter::write(int object, std::string_view value) {
  places_.at(static_cast<std::size_t>(object - 1)) = at_;
  put(fmt::format("{} 0 obj\n{}\nendobj\n", object, value));
}

void PdfWriter::write_stream(int object, std::string_view entries, std::string_view data) {
  places_.at(static_cast<std::size_t>(object - 1)) = at_;
  put(fmt::format("{} 0 obj\n<< {} /Length {} >>\nstream\n", object, entries, data.size()));
  put(data);
  put("\nendstream\nendobj\n");
}

void PdfWriter::write_packed_stream(int object, const std::string& entries, std::string_view data) {
  write_stream(object, entries + " /Filter /FlateDecode", deflate(data));
}

void PdfWriter::finish(int catalog, std::string_view id) {
  constexpr std::uint64_t most_bytes = 9'999'999'999;  // ten digits in the table
  const std::uint64_t table_at = at_;
  if (table_at > most_bytes) throw cannot_write(file_, "a PDF of more than 10 GB: deliver fewer pages in one job");
  std::string table = fmt::format("xref\n0 {}\n0000000000 65535 f \n", places_.size() + 1);
  for (const std::uint64_t place : places_) {
    if (place == 0) throw std::logic_error("PdfWriter: an object was reserved and never written");
    table += fmt::format("{:010} 00000 n \n", place);
  }
  put(table);
  const std::string id_text = pdf_hex(id);
  put(fmt::format("trailer\n<< /Size {} /Root {} /ID [{} {}] >>\nstartxref\n{}\n%%EOF\n", places_.size() + 1,
                  pdf_reference(catalog), id_text, id_text, table_at));
  stream_.close();
  if (!stream_) throw cannot_write(file_, "the disk may be full");
}

}  // namespace pagesweep
