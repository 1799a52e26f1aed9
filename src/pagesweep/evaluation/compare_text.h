// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string_view>

#include "pagesweep/evaluation/statistics.h"

namespace pagesweep {

/// How well a text was recognised.
struct TextErrors {
  std::size_t characters = 0;        ///< of the true text
  std::size_t edits = 0;             ///< characters to insert, delete or replace: Levenshtein's distance
  double rate = ErrorSummary::none;  ///< character error rate, edits / characters
};

/// Compares texts character by character (Unicode code points). White space counts as one blank however much of it
/// there is, because where lines end is no part of the text; at both ends it counts nothing.
/// \param truth, found  UTF-8; a byte that is none counts as a character
TextErrors compare_text(std::string_view truth, std::string_view found);

}  // namespace pagesweep
