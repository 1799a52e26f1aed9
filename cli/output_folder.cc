// SPDX-License-Identifier: Apache-2.0
#include "cli/output_folder.h"

#include "pagesweep/base/error.h"

namespace pagesweep::cli {

namespace fs = std::filesystem;

OutputFolder::OutputFolder(fs::path folder, std::string index) : folder_(std::move(folder)), index_(std::move(index)) {
  if (folder_.filename().empty()) folder_ = folder_.parent_path();  // "out/"
  std::error_code failure;
  if (fs::exists(folder_, failure) && !fs::is_directory(folder_, failure))
    throw cannot_write(folder_, "it is a file, and a folder is needed");
  for (fs::path path = folder_; !path.empty() && !fs::exists(path, failure); path = path.parent_path()) made_ = path;
  fs::create_directories(folder_, failure);
  if (failure) throw cannot_write(folder_, failure.message());
}

OutputFolder::~OutputFolder() {
  std::error_code ignored;
  if (!finished_ && !made_.empty()) fs::remove_all(made_, ignored);
}

void OutputFolder::begin() {
  std::error_code failure;
  fs::remove(folder_ / index_, failure);
  if (failure) throw cannot_write(folder_ / index_, failure.message());
}

}  // namespace pagesweep::cli
