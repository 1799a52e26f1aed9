// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/delivery/page_source.h"

#include <fmt/format.h>

#include "pagesweep/base/error.h"
#include "pagesweep/io/page_name.h"
#include "pagesweep/io/pages_file.h"
#include "pagesweep/io/result_files.h"

namespace pagesweep {
namespace {

namespace fs = std::filesystem;

std::string name_of_folder(const fs::path& folder) {
  std::error_code failure;
  return fs::weakly_canonical(folder, failure).filename().string();
}

std::vector<PageSource> pages_of_folder(const fs::path& folder) {
  const auto listed = read_pages_file(folder);
  const std::string capture = listed && !listed->capture.empty() ? listed->capture : name_of_folder(folder);
  const std::vector<int> indices = pages_in(folder);
  std::vector<PageSource> pages;
  for (const int index : indices) {
    const std::vector<fs::path> pictures = PageFiles(folder, index).pictures();
    if (pictures.empty())
      throw cannot_read(folder, fmt::format("there is no picture of page {}: dewarp it again", index));
    pages.push_back({pictures.front(), capture, side_of(index, static_cast<int>(indices.size())), index});
  }
  if (pages.empty())
    throw cannot_read(folder, "it has no pages: give folders that `pagesweep scan` wrote, or pictures");
  return pages;
}

}  // namespace

std::vector<PageSource> find_pages(std::span<const fs::path> results) {
  std::vector<PageSource> pages;
  for (const fs::path& result : results) {
    if (!fs::exists(result)) throw cannot_read(result, "there is no such folder or file");
    if (!fs::is_directory(result)) {
      pages.push_back({result, result.stem().string(), "single", 1});
      continue;
    }
    for (PageSource& page : pages_of_folder(result)) pages.push_back(std::move(page));
  }
  return pages;
}

}  // namespace pagesweep
