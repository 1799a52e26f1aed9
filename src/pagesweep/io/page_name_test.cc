// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/page_name.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

namespace pagesweep {
namespace {

using testing::HasSubstr;

std::string problem_of(const std::string& pattern, const std::vector<PageNaming>& pages = {}) {
  try {
    PageNamePattern{pattern}.names(pages);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(PageNamePattern, PutsInWhatThePageHas) {
  const PageNaming page{12, 2, "right", "faust"};
  EXPECT_EQ(PageNamePattern("book_{page:04}")(page), "book_0012");
  EXPECT_EQ(PageNamePattern("{capture}-{side}")(page), "faust-right");
  EXPECT_EQ(PageNamePattern("{page}{index}")(page), "122");
  EXPECT_EQ(PageNamePattern("{page:1}")({12345, 1, {}, {}}), "12345");
}

TEST(PageNamePattern, SaysWhatIsWrong) {
  EXPECT_THAT(problem_of("p{number}"), AllOf(HasSubstr("'p{number}'"), HasSubstr("no {number}, only {page}")));
  EXPECT_THAT(problem_of("p{page"), HasSubstr("brace"));
  EXPECT_THAT(problem_of("p}"), HasSubstr("brace"));
  EXPECT_THAT(problem_of("{{page}}"), HasSubstr("brace"));
  EXPECT_THAT(problem_of("{page:x}"), HasSubstr("digits"));
  EXPECT_THAT(problem_of("{page:0}"), HasSubstr("digits"));
  EXPECT_THAT(problem_of("{side:3}"), HasSubstr("digits"));
  EXPECT_THAT(problem_of("../{page}"), HasSubstr("dot"));
  EXPECT_THAT(problem_of("a/{page}"), HasSubstr("slash"));
  EXPECT_THAT(problem_of(""), HasSubstr("empty"));
}

TEST(PageNamePattern, NamesThePagesThatClash) {
  const std::vector<PageNaming> pages = {{1, 1, "left", "a"}, {2, 2, "right", "a"}, {3, 1, "left", "b"}};
  EXPECT_EQ(problem_of("{page}", pages), "");
  EXPECT_THAT(problem_of("{side}", pages), HasSubstr("page 1 of a and page 1 of b would both be called 'left'"));
}

TEST(PageNamePattern, KnowsTheSidesOfASpread) {
  EXPECT_EQ(side_of(1, 2) + side_of(2, 2), "leftright");
  EXPECT_EQ(side_of(1, 1), "single");
  EXPECT_EQ(side_of(2, 5), "single");
}

}  // namespace
}  // namespace pagesweep
