// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "pagesweep/base/error.h"
#include "pagesweep/io/atomic_file.h"

namespace pagesweep::test {

/// A folder for one test's files, which goes when the test ends.
class TestFolder {
 public:
  TestFolder() {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    std::string name = std::string(test->test_suite_name()) + "." + test->name();
    for (char& c : name)
      if (c == '/') c = '_';
    path_ = std::filesystem::path(testing::TempDir()) / ("pagesweep." + name);
    std::filesystem::remove_all(path_);
    std::filesystem::create_directories(path_);
  }
  ~TestFolder() { std::filesystem::remove_all(path_); }
  TestFolder(const TestFolder&) = delete;
  TestFolder& operator=(const TestFolder&) = delete;

  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  const std::filesystem::path& path() const { return path_; }
  std::size_t files() const {
    std::size_t count = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(path_)) count += entry.is_regular_file();
    return count;
  }

 private:
  std::filesystem::path path_;
};

/// What the Error says that `action` throws; "" if it throws none.
template <class Action>
std::string error_of(const Action& action) {
  try {
    action();
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

/// Replaces the one place in a text.
inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

/// Gives every chunk of a PNG the checksum that belongs to it, so that a changed one is looked into.
inline std::string with_checksums(std::string png) {
  const auto number_at = [&](std::size_t at) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(png[at + i]);
    return value;
  };
  for (std::size_t at = 8; at + 12 <= png.size();) {
    const std::size_t length = number_at(at);
    if (length > png.size() - at - 12) break;
    std::uint32_t checksum = 0xffffffff;
    for (std::size_t i = at + 4; i < at + 8 + length; ++i) {
      checksum ^= static_cast<unsigned char>(png[i]);
      for (int bit = 0; bit < 8; ++bit) checksum = (checksum >> 1) ^ (checksum & 1 ? 0xedb88320U : 0);
    }
    for (std::size_t i = 0; i < 4; ++i) png[at + 8 + length + i] = static_cast<char>(~checksum >> (24 - 8 * i));
    at += 12 + length;
  }
  return png;
}

/// Writes a file anew. To replace it instead would wait for the disk, which hurts in a loop.
inline void put(const std::filesystem::path& file, std::string_view bytes) {
  std::filesystem::remove(file);
  write_bytes(file, bytes);
}

inline std::string read_text(const std::filesystem::path& file) { return read_bytes(file, std::size_t{1} << 30); }

}  // namespace pagesweep::test
