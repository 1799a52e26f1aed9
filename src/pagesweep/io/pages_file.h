// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace pagesweep {

/// One flat page of a result folder.
struct PageEntry {
  int index = 1;        ///< from left to right, 1 first
  std::string picture;  ///< name of its file in the folder
  std::string side;     ///< "left", "right" or "single"
};

/// pages.json: which pages a result folder has (docs/formats.md, "Results").
struct PagesFile {
  std::string capture;  ///< name of the capture
  std::vector<PageEntry> pages;
};

void write_pages_file(const std::filesystem::path& folder, const PagesFile& file);

/// \return  nothing if the folder has no pages.json
/// \throws Error  if it has one that cannot be used
std::optional<PagesFile> read_pages_file(const std::filesystem::path& folder);

}  // namespace pagesweep
