// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/compare_text.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace pagesweep {
namespace {

TEST(CompareText, CountsEditsByHand) {
  EXPECT_EQ(compare_text("kitten", "sitting").edits, 3u);  // two replaced, one inserted
  EXPECT_EQ(compare_text("light", "").edits, 5u);
  EXPECT_DOUBLE_EQ(compare_text("abcd", "abd").rate, 0.25);
}

TEST(CompareText, WhereLinesEndIsNoPartOfTheText) {
  EXPECT_EQ(compare_text("one two\nthree", "  one\ntwo \n\n three\n").edits, 0u);
  EXPECT_EQ(compare_text("one two", "onetwo").edits, 1u);
}

TEST(CompareText, ALetterOfSeveralBytesIsOneCharacter) {
  const TextErrors errors = compare_text("Grüße – 纸", "Gruße — 纸");
  EXPECT_EQ(errors.characters, 9u);
  EXPECT_EQ(errors.edits, 2u);
}

TEST(CompareText, BrokenUtf8IsCompared) { EXPECT_EQ(compare_text("a\xC3", "a\xFFz").edits, 2u); }

TEST(CompareText, AnEmptyTruthHasNoRate) { EXPECT_TRUE(std::isnan(compare_text("", "x").rate)); }

}  // namespace
}  // namespace pagesweep
