// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/page_name.h"

#include <fmt/format.h>

#include <charconv>
#include <map>
#include <stdexcept>

namespace pagesweep {

std::string side_of(int index, int pages) {
  if (pages != 2) return "single";
  return index == 1 ? "left" : "right";
}

PageNamePattern::PageNamePattern(std::string pattern) : pattern_(std::move(pattern)) {
  if (pattern_.empty() || pattern_.starts_with('.')) fail("a name may neither be empty nor begin with a dot");
  if (pattern_.find('/') != std::string::npos) fail("a name may not have a slash in it");
  for (std::size_t at = 0; at < pattern_.size();) {
    const std::size_t brace = pattern_.find_first_of("{}", at);
    if (brace > at) parts_.push_back({pattern_.substr(at, brace - at), {}});
    if (brace == std::string::npos) break;
    const std::size_t end = pattern_.find_first_of("{}", brace + 1);
    if (pattern_[brace] == '}' || end == std::string::npos || pattern_[end] == '{')
      fail("a brace is not closed or not opened");
    parts_.push_back(read_field(pattern_.substr(brace + 1, end - brace - 1)));
    at = end + 1;
  }
}

PageNamePattern::Part PageNamePattern::read_field(const std::string& field) const {
  const std::size_t colon = field.find(':');
  Part part{{}, field.substr(0, colon)};
  const bool is_number = part.field == "page" || part.field == "index";
  if (!is_number && part.field != "side" && part.field != "capture")
    fail(fmt::format("there is no {{{}}}, only {{page}}, {{index}}, {{side}} and {{capture}}", part.field));
  if (colon == std::string::npos) return part;
  const std::string digits = field.substr(colon + 1);
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), part.digits);
  if (!is_number || error != std::errc() || end != digits.data() + digits.size() || part.digits < 1 || part.digits > 20)
    fail("after a colon stands how many digits a number has, as in {page:04}");
  return part;
}

void PageNamePattern::fail(const std::string& problem) const {
  throw std::invalid_argument(fmt::format("the pattern '{}' for the names of pages: {}", pattern_, problem));
}

std::string PageNamePattern::operator()(const PageNaming& page) const {
  std::string name;
  for (const Part& part : parts_) {
    name += part.text;
    if (part.field == "page" || part.field == "index")
      name += fmt::format("{:0{}}", part.field == "page" ? page.page : page.index, part.digits);
    if (part.field == "side") name += page.side;
    if (part.field == "capture") name += page.capture;
  }
  return name;
}

std::vector<std::string> PageNamePattern::names(const std::vector<PageNaming>& pages) const {
  std::vector<std::string> names;
  std::map<std::string, const PageNaming*> owners;
  for (const PageNaming& page : pages) {
    names.push_back((*this)(page));
    const auto [owner, is_new] = owners.try_emplace(names.back(), &page);
    if (!is_new)
      fail(fmt::format("page {} of {} and page {} of {} would both be called '{}'; put {{page}} into it",
                       owner->second->index, owner->second->capture, page.index, page.capture, names.back()));
  }
  return names;
}

}  // namespace pagesweep
