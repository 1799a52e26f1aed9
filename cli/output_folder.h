// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

namespace pagesweep::cli {

/// The folder that a run writes. One file, the index (report.json, capture.json), is written last: a folder without it
/// is unfinished. A run that fails takes the folders away that it made.
class OutputFolder {
 public:
  /// Makes the folder, so that a wrong path fails before the work and not after it.
  /// \throws Error  if it cannot be made
  OutputFolder(std::filesystem::path folder, std::string index);
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  const std::filesystem::path& path() const { return folder_; }
  /// To be called before the first file is written: takes away the index of an earlier run.
  void begin();
  /// To be called after the last file.
  void finish() { finished_ = true; }

 private:
  std::filesystem::path folder_;
  std::string index_;
  std::filesystem::path made_;  ///< the uppermost folder that was not there before; empty: none
  bool finished_ = false;
};

}  // namespace pagesweep::cli
