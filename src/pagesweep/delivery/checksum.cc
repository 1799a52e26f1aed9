// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/delivery/checksum.h"

#include <glib.h>

#include <fstream>
#include <vector>

#include "pagesweep/base/error.h"

namespace pagesweep {

struct Sha256::State {
  GChecksum* checksum = g_checksum_new(G_CHECKSUM_SHA256);
  ~State() { g_checksum_free(checksum); }
};

Sha256::Sha256() : state_(std::make_unique<State>()) {}
Sha256::~Sha256() = default;

void Sha256::add(std::string_view bytes) {
  g_checksum_update(state_->checksum, reinterpret_cast<const guchar*>(bytes.data()), static_cast<gssize>(bytes.size()));
}

std::string Sha256::digits() { return g_checksum_get_string(state_->checksum); }

std::string sha256_of(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw cannot_read(file, "it cannot be opened");
  Sha256 sum;
  std::vector<char> block(std::size_t{1} << 20);
  while (stream) {
    stream.read(block.data(), static_cast<std::streamsize>(block.size()));
    sum.add({block.data(), static_cast<std::size_t>(stream.gcount())});
  }
  if (stream.bad()) throw cannot_read(file, "reading failed");
  return sum.digits();
}

}  // namespace pagesweep
