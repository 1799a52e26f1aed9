// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace pagesweep {

struct ProgramOutput {
  int exit_code = 0;  ///< 128 + n if signal n ended it
  std::string output;
  std::string messages;  ///< what it said on stderr
};

/// Runs another program to its end, without a shell. It reads nothing, and its own threads are limited to one, because
/// pages are worked on side by side.
/// \return  nothing if there is no such program on the PATH
/// \throws Error  if it cannot be started for another reason, or says more than a gigabyte
std::optional<ProgramOutput> run_program(const std::vector<std::string>& words);

/// A folder for files that only this process needs; it goes with the object.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

}  // namespace pagesweep
