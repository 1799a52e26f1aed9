// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace pagesweep {

/// A flat page that waits to be delivered.
struct PageSource {
  std::filesystem::path picture;
  std::string capture;  ///< name of its capture or, failing that, of its folder
  std::string side;     ///< "left", "right" or "single"
  int index = 1;        ///< within its scan
};

/// The pages of result folders, in the order of the folders and from left to right within each; a picture's file may
/// stand for a folder.
/// \throws Error  if one is missing, or a folder has no pages
std::vector<PageSource> find_pages(std::span<const std::filesystem::path> results);

}  // namespace pagesweep
