// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

namespace pagesweep {

/// SHA-256 (FIPS 180-4) of bytes that come one after the other.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;

  void add(std::string_view bytes);
  /// 64 hexadecimal digits. Nothing may be added after it.
  std::string digits();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Of a whole file.
/// \throws Error  if it cannot be read
std::string sha256_of(const std::filesystem::path& file);

}  // namespace pagesweep
