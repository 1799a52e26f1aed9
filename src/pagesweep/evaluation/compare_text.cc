// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/compare_text.h"

#include <algorithm>
#include <string>
#include <vector>

namespace pagesweep {
namespace {

/// Code point of the UTF-8 sequence at `at`, which is moved behind it; a stray byte stands for itself.
char32_t next_character(std::string_view text, std::size_t& at) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char first = byte(at);
  const std::size_t length = first < 0xC0 ? 1 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : 4;
  if (length == 1 || at + length > text.size()) return byte(at++);
  char32_t value = first & (0x7FU >> length);
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(at + i) & 0xC0) != 0x80) return byte(at++);
    value = value << 6 | (byte(at + i) & 0x3FU);
  }
  at += length;
  return value;
}

std::u32string characters_of(std::string_view text) {
  constexpr char32_t no_break_space = 0xA0;
  std::u32string characters;
  bool blank = false;
  for (std::size_t at = 0; at < text.size();) {
    const char32_t c = next_character(text, at);
    if (c <= U' ' || c == no_break_space) {
      blank = true;
      continue;
    }
    if (blank && !characters.empty()) characters += U' ';
    blank = false;
    characters += c;
  }
  return characters;
}

std::size_t levenshtein_distance(std::u32string_view a, std::u32string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] != b[j - 1]);
      diagonal = row[j];
      row[j] = std::min({replaced, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row[b.size()];
}

}  // namespace

TextErrors compare_text(std::string_view truth, std::string_view found) {
  const std::u32string a = characters_of(truth), b = characters_of(found);
  TextErrors errors{a.size(), levenshtein_distance(a, b), ErrorSummary::none};
  if (errors.characters > 0) errors.rate = static_cast<double>(errors.edits) / static_cast<double>(errors.characters);
  return errors;
}

}  // namespace pagesweep
