// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "pagesweep/dewarping/page_pieces_internal.h"

namespace pagesweep {
namespace {

/// Bright cells side by side in a row, and what the piece that they stand for has.
struct Run {
  int y, begin, end;  ///< cells [begin, end)
  std::size_t piece;  ///< a run of the same piece: its first one, or one that leads there
  std::size_t cells = 0, measured = 0;
};

class Runs {
 public:
  Runs(const Image<char>& bright, const Image<char>& measured) {
    std::size_t above = 0;  // the first run of the row above
    for (int y = 0; y < bright.height(); ++y) {
      const std::size_t row = runs_.size();
      cut_row(bright.row(y), measured.row(y), y);
      join(above, row);
      above = row;
    }
    for (Run& run : runs_) {
      Run& first = runs_[first_of(run)];
      if (&first == &run) continue;
      first.cells += run.cells;
      first.measured += run.measured;
    }
  }

  const std::vector<Run>& all() const { return runs_; }
  const Run& piece_of(const Run& run) const { return runs_[first_of(run)]; }
  bool is_piece(const Run& run) const { return &piece_of(run) == &run; }

 private:
  std::size_t first_of(const Run& run) const {
    std::size_t k = run.piece;
    while (runs_[k].piece != k) k = runs_[k].piece;
    return k;
  }

  void cut_row(std::span<const char> bright, std::span<const char> measured, int y) {
    for (auto at = bright.begin();
         (at = std::ranges::find_if(at, bright.end(), [](char b) { return b != 0; })) != bright.end();) {
      const auto end = std::ranges::find(at, bright.end(), char{0});
      const auto x = at - bright.begin(), x_end = end - bright.begin();
      Run run{y, static_cast<int>(x), static_cast<int>(x_end), runs_.size()};
      run.cells = static_cast<std::size_t>(x_end - x);
      run.measured =
          run.cells - static_cast<std::size_t>(std::count(measured.begin() + x, measured.begin() + x_end, char{0}));
      runs_.push_back(run);
      at = end;
    }
  }

  /// Joins the runs from `row` on to those of the row above, [above, row), that have a column in common.
  void join(std::size_t above, std::size_t row) {
    for (std::size_t a = above, b = row; a < row && b < runs_.size();) {
      if (runs_[a].begin < runs_[b].end && runs_[b].begin < runs_[a].end) {
        const std::size_t one = first_of(runs_[a]), other = first_of(runs_[b]);
        runs_[std::max(one, other)].piece = std::min(one, other);
      }
      runs_[a].end < runs_[b].end ? ++a : ++b;
    }
  }

  std::vector<Run> runs_;
};

}  // namespace

Image<char> keep_page_pieces(const Image<char>& bright, const Image<char>& measured) {
  const Runs runs(bright, measured);
  const auto is_piece = [&](const Run& run) { return runs.is_piece(run); };
  const bool any_measured =
      std::ranges::any_of(runs.all(), [&](const Run& run) { return is_piece(run) && run.measured > 0; });
  const auto may_belong = [&](const Run& piece) { return !any_measured || piece.measured > 0; };
  std::size_t largest = 0;
  for (const Run& run : runs.all())
    if (is_piece(run) && may_belong(run)) largest = std::max(largest, run.cells);
  Image<char> page(bright.width(), bright.height());
  for (const Run& run : runs.all()) {
    const Run& piece = runs.piece_of(run);
    if (may_belong(piece) && (10 * piece.cells > largest || 2 * piece.measured > piece.cells))
      std::fill_n(&page(run.begin, run.y), run.end - run.begin, char{1});
  }
  return page;
}

}  // namespace pagesweep
