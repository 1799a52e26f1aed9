// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace pagesweep {

/// A file that appears whole or not at all: write to temporary(), then commit() renames it to its name. Without
/// commit() nothing is left behind.
class AtomicFile {
 public:
  /// Makes the target's folder if it is missing, and an empty file in it that ends in the target's extension.
  /// \throws Error  if it cannot be written there
  explicit AtomicFile(std::filesystem::path target);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  const std::filesystem::path& target() const { return target_; }
  const std::filesystem::path& temporary() const { return temporary_; }
  /// \throws Error  if the file cannot take its name
  void commit();

 private:
  std::filesystem::path target_;
  std::filesystem::path temporary_;  ///< empty once committed
};

/// Writes a whole file.
/// \throws Error  if it cannot be written
void write_bytes(const std::filesystem::path& file, std::string_view bytes);

struct NamedText {
  std::string name;  ///< of the file in its folder
  std::string text;
};

/// Writes files of one folder that belong together. Each is whole before the first takes its name.
/// \throws Error  if one cannot be written
void write_together(const std::filesystem::path& folder, std::span<const NamedText> files);

/// Reads a whole file.
/// \throws Error  if it cannot be read, or holds more than `most_bytes`
std::string read_bytes(const std::filesystem::path& file, std::size_t most_bytes);

}  // namespace pagesweep
