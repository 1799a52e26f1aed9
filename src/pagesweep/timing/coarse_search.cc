// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/coarse_search_internal.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

#include "pagesweep/timing/row_kernels_internal.h"

namespace pagesweep {
namespace {

constexpr int longest_block = 256;  // [frames] whose sum of bytes fits into 16 bit

}  // namespace

CoarseSearch::CoarseSearch(int frame_count, double fwhm, double read_variance)
    : frame_count_(frame_count),
      block_(std::clamp(static_cast<int>(std::lround(0.5 * fwhm)), 1, longest_block)),
      // The response counts the middle's 2 blocks twice; the sides add half of the middle's variance.
      per_sigma_(1 / (4.0 * block_ * std::sqrt(1.5 * read_variance / (2 * block_)))) {}

template <class T>
void CoarseSearch::sum_blocks(const RowsOf<T>& rows, int pad, int left) {
  for (int k = 0; k < sums_.height(); ++k) {
    const int begin = k * block_, count = std::min(block_, frame_count_ - begin);
    const auto frames = std::span(rows).subspan(static_cast<std::size_t>(pad + begin), static_cast<std::size_t>(count));
    sum_rows(frames, left, static_cast<float>(block_) / static_cast<float>(count), sums_.row(k));
  }
}

void CoarseSearch::find(const RawRow& row, int pad, int left, int columns) {
  const int blocks = (frame_count_ + block_ - 1) / block_, places = std::max(0, blocks - 1);
  if (sums_.width() != columns) {
    sums_ = Image<float>(columns, blocks);
    responses_ = Image<float>(columns, places);
  }
  std::visit([&](const auto& rows) { sum_blocks(rows, pad, left); }, row);
  rise_.assign(static_cast<std::size_t>(columns), -std::numeric_limits<float>::infinity());
  best_.assign(static_cast<std::size_t>(columns), 0);
  for (int k = 0; k < places; ++k) {
    const bool has_left = k >= 3, has_right = k + 4 < blocks;
    if (!has_left && !has_right) continue;
    // Where one side is missing, the other stands for both.
    const int left_side = has_left ? k - 3 : k + 3, right_side = has_right ? k + 3 : k - 3;
    const auto block = [&](int i) { return sums_.row(i).data(); };
    keep_highest(
        {{block(k), block(k + 1)}, {block(left_side), block(left_side + 1), block(right_side), block(right_side + 1)}},
        k, responses_.row(k), rise_, best_);
  }
}

int CoarseSearch::frame(int x) const {
  const int k = best_[static_cast<std::size_t>(x)];
  double place = (k + 1) * block_ - 0.5;
  if (k > 0 && k + 1 < responses_.height()) {
    const double before = responses_(x, k - 1), here = responses_(x, k), after = responses_(x, k + 1);
    const double bend = before - 2 * here + after;
    if (bend < 0) place += block_ * std::clamp(0.5 * (before - after) / bend, -0.5, 0.5);
  }
  return static_cast<int>(std::lround(std::clamp(place, 0.0, frame_count_ - 1.0)));
}

}  // namespace pagesweep
