// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "pagesweep/base/error.h"

namespace pagesweep {

/// The first picture of a TIFF, opened with libtiff. Whatever is wrong becomes an Error with libtiff's own words;
/// nothing is printed. Not for two threads at a time.
class TiffReader {
 public:
  explicit TiffReader(const std::filesystem::path& file);
  ~TiffReader();

  enum class SampleFormat { unsigned_integer, signed_integer, floating_point, other };
  struct Layout {
    int width = 0;   ///< [px]
    int height = 0;  ///< [px]
    int channels = 0;
    int bits_per_sample = 0;
    SampleFormat format = SampleFormat::unsigned_integer;
    bool black_is_zero = true;  ///< or RGB: more is brighter
    bool has_palette = false;
  };
  const Layout& layout() const { return layout_; }

  /// Decodes all samples, interleaved: width * channels samples a row, in the machine's byte order.
  /// \param out  of width * height * channels * bits_per_sample / 8 bytes
  void read_samples(std::span<std::byte> out);

  /// An error about this file, with what libtiff said last.
  Error error(const std::string& problem) const;

 private:
  struct Handle;
  void read_layout();
  void require_plausible_size() const;
  void read_blocks(std::span<std::byte> out);

  std::filesystem::path file_;
  std::unique_ptr<Handle> handle_;
  Layout layout_;
};

}  // namespace pagesweep
