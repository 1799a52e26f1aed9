// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/coarse_search_internal.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "pagesweep/data/time_map.h"
#include "pagesweep/timing/row_kernels_internal.h"

namespace pagesweep {
namespace {

constexpr int longest_block = 256;  // [frames] whose sum of bytes fits into 16 bit
// Place k lies between blocks k and k + 1; its response also takes blocks k - 3, k - 2 and k + 3, k + 4.
constexpr int blocks_before = 3, blocks_after = 4;

}  // namespace

CoarseSearch::CoarseSearch(int width, int height, double fwhm, double read_variance)
    : block_(std::clamp(static_cast<int>(std::lround(0.5 * fwhm)), 1, longest_block)),
      // The response counts the middle's 2 blocks twice; the sides add half of the middle's variance.
      per_sigma_(static_cast<float>(1 / (4.0 * block_ * std::sqrt(1.5 * read_variance / (2 * block_))))),
      rise_(width, height, -std::numeric_limits<float>::infinity()),
      before_(width, height, not_a_number),
      after_(width, height, not_a_number),
      best_(width, height, -1) {}

CoarseSearch::Step CoarseSearch::next_step(int done, int frame_count, bool ended) const {
  Step step;
  step.frame_count = frame_count;
  step.ended = ended;
  step.end_block = ended ? (frame_count + block_ - 1) / block_ : frame_count / block_;
  step.first_place = done;
  step.end_place = std::max(done, ended ? step.end_block - 1 : step.end_block - blocks_after);
  step.first_block = std::max(0, done - 1 - blocks_before);  // the response before the first place takes part
  return step;
}

template <class T>
void CoarseSearch::sum_blocks(const Step& step, const RowsOf<T>& rows, int first_frame, int left, int columns,
                              Image<float>& sums) const {
  for (int k = step.first_block; k < step.end_block; ++k) {
    const int begin = k * block_, count = std::min(block_, step.frame_count - begin);
    const auto frames =
        std::span(rows).subspan(static_cast<std::size_t>(begin - first_frame), static_cast<std::size_t>(count));
    // A block that the recording's end has cut counts as a whole one.
    sum_rows(frames, left, static_cast<float>(block_) / static_cast<float>(count),
             sums.row(k - step.first_block).first(static_cast<std::size_t>(columns)));
  }
}

void CoarseSearch::look(const Step& step, const RawRow& rows, int first_frame, int y, int left, int columns,
                        Image<float>& sums) {
  if (step.first_place == step.end_place) return;
  const int blocks = step.end_block - step.first_block;
  if (sums.width() < columns || sums.height() < blocks) sums = Image<float>(rise_.width(), blocks);
  std::visit([&](const auto& present) { sum_blocks(step, present, first_frame, left, columns, sums); }, rows);
  std::vector<Place> places;
  for (int k = std::max(0, step.first_place - 1); k < step.end_place; ++k) {
    const bool has_left = k >= blocks_before, has_right = k + blocks_after < step.end_block;
    if (!has_left && !has_right) continue;
    // Where one side is missing, the other stands for both.
    const int left_side = has_left ? k - 3 : k + 3, right_side = has_right ? k + 3 : k - 3;
    const auto block = [&](int i) { return sums.row(i - step.first_block).data(); };
    places.push_back({{block(k), block(k + 1)},
                      {block(left_side), block(left_side + 1), block(right_side), block(right_side + 1)},
                      k});
  }
  if (places.empty()) return;
  const bool has_previous = places.front().number < step.first_place;
  const auto at = static_cast<std::size_t>(left);
  keep_highest(has_previous ? &places.front() : nullptr, std::span(places).subspan(has_previous ? 1 : 0),
               {&rise_.row(y)[at], &before_.row(y)[at], &after_.row(y)[at], &best_.row(y)[at]},
               static_cast<std::size_t>(columns));
}

int CoarseSearch::frame(int x, int y, int frame_count) const {
  double place = (best_(x, y) + 1) * block_ - 0.5;
  const double before = before_(x, y), here = rise_(x, y), after = after_(x, y);
  const double bend = before - 2 * here + after;
  if (bend < 0) place += block_ * std::clamp(0.5 * (before - after) / bend, -0.5, 0.5);
  return static_cast<int>(std::clamp(place, 0.0, frame_count - 1.0) + 0.5);
}

}  // namespace pagesweep
