// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace pagesweep {

/// What a page's file can be named after.
struct PageNaming {
  int page = 1;         ///< running number, as the user counts
  int index = 1;        ///< within its scan, from left to right
  std::string side;     ///< "left", "right", or "single" where a scan does not have two pages
  std::string capture;  ///< name of the capture or of the result folder
};

/// Which side of a spread a page is.
std::string side_of(int index, int pages);

/// A pattern such as "book_{page:04}" or "{capture}_{side}": text, and in braces what PageNaming has: page, index,
/// side, capture. A number after a colon gives the least number of digits, with zeros in front.
class PageNamePattern {
 public:
  /// \throws std::invalid_argument  that says what is wrong with the pattern
  explicit PageNamePattern(std::string pattern);

  /// The name, without extension.
  std::string operator()(const PageNaming& page) const;
  /// The names of pages that will lie in one folder.
  /// \throws std::invalid_argument  if two of them are the same
  std::vector<std::string> names(const std::vector<PageNaming>& pages) const;

 private:
  struct Part {
    std::string text, field;  ///< the one or the other
    int digits = 1;
  };
  [[noreturn]] void fail(const std::string& problem) const;
  Part read_field(const std::string& field) const;

  std::string pattern_;
  std::vector<Part> parts_;
};

}  // namespace pagesweep
