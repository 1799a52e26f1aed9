// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace pagesweep {

/// sums[x] = before[x] + weight * min(frame[x], ceiling).
void add_weighted(std::span<const float> before, std::span<const float> frame, float weight, float ceiling,
                  std::span<float> sums);

/// The mean of each pixel over some frames: factor * (end[x] - begin[x]), of running sums.
struct MeanOfFrames {
  const float* begin;
  const float* end;
  float factor;

  float of(std::size_t x) const { return factor * (end[x] - begin[x]); }
};

/// Where middle - left - right exceeds rise[x], it replaces rise[x], and `index` frame[x].
void keep_highest(const MeanOfFrames& middle, const MeanOfFrames& left, const MeanOfFrames& right, std::int32_t index,
                  std::span<float> rise, std::span<std::int32_t> frame);

}  // namespace pagesweep
