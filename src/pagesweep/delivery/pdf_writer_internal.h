// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

namespace pagesweep {

/// Writes the objects of a PDF file (ISO 32000-1) one after the other, and keeps only where they are. Nothing of it is
/// specific to pages or archives.
class PdfWriter {
 public:
  /// \throws Error  if the file cannot be written
  explicit PdfWriter(const std::filesystem::path& file);

  /// Number of an object that is written later.
  int reserve();
  void write(int object, std::string_view value);
  /// \param entries  of the dictionary, without /Length
  void write_stream(int object, std::string_view entries, std::string_view data);
  /// Likewise, packed by deflate.
  void write_packed_stream(int object, const std::string& entries, std::string_view data);
  /// Cross-reference table and trailer. Nothing may be written after it.
  /// \param id  16 bytes that tell this file from others
  /// \throws Error  if anything could not be written, or an object is missing
  void finish(int catalog, std::string_view id);

 private:
  void put(std::string_view bytes);

  std::filesystem::path file_;
  std::ofstream stream_;
  std::uint64_t at_ = 0;
  std::vector<std::uint64_t> places_;  ///< of objects 1, 2, ...; 0: not written yet
};

/// "12 0 R"
std::string pdf_reference(int object);
/// "(text)" as UTF-16 with byte order mark in hexadecimal digits, whatever the text holds.
std::string pdf_text(std::string_view utf8);
/// "<hex digits>"
std::string pdf_hex(std::string_view bytes);
/// Packed by deflate, in zlib's wrapping.
std::string deflate(std::string_view bytes);
/// Code points of a UTF-8 text; U+FFFD for what is none.
std::u32string decode_utf8(std::string_view text);
/// UTF-16, big-endian.
std::string encode_utf16(char32_t character);

}  // namespace pagesweep
