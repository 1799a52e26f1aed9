// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/find_paper.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

constexpr double print_mm = 5;          // half of the largest dark stroke that paper closes around
constexpr double clear_contrast = 0.6;  // table: brightness below this share of the paper's
constexpr double step_mm = 1;           // height step between neighbours that ends a surface
constexpr double cover_step_mm = 0.4;   // the same where a surface lies on paper
constexpr double least_cover_mm2 = 30;
constexpr double steepest = 2.2;      // dz / d(p, q) beyond which a surface ends (65 degrees)
constexpr double edge_drop_mm = 1.5;  // table lies lower than the paper's edge by more
constexpr double table_depth_mm = 5, table_flatness_mm = 0.7;

/// Largest (or smallest) value within `reach` cells along the rows, or along the columns; NaN where there is none.
template <class Better>
Image<float> extreme(const Image<float>& image, int reach, bool along_rows, Better better) {
  Image<float> result(image.width(), image.height(), not_a_number);
  parallel_rows(image.height(), [&](int y) {
    const std::span<float> best = result.row(y);
    for (int k = -reach; k <= reach; ++k) {  // whole rows at a time, so that the compiler makes vectors of them
      const int di = along_rows ? k : 0, dj = along_rows ? 0 : k;
      if (y + dj < 0 || y + dj >= image.height()) continue;
      const std::span<const float> other = image.row(y + dj);
      const int begin = std::max(0, -di), end = std::min(image.width(), image.width() - di);
      for (int x = begin; x < end; ++x) {
        const float value = other[static_cast<std::size_t>(x + di)];
        float& so_far = best[static_cast<std::size_t>(x)];
        so_far = std::isnan(so_far) || better(value, so_far) ? value : so_far;
      }
    }
  });
  return result;
}

/// Brightness of the ground that print stands on: grey value closing, which fills what is narrower than two reaches.
Image<float> close_print(const Image<float>& brightness, int reach) {
  const auto larger = std::greater<float>{};
  const auto smaller = std::less<float>{};
  const Image<float> grown = extreme(extreme(brightness, reach, true, larger), reach, false, larger);
  return extreme(extreme(grown, reach, true, smaller), reach, false, smaller);
}

/// Otsu's threshold (1979) on the logarithm of the brightness; 0 if the two classes do not differ clearly.
double split_brightness(const Image<float>& ground, const Image<std::uint8_t>& measured) {
  constexpr std::size_t bins = 1024;
  std::vector<float> logs;
  for (std::size_t k = 0; k < ground.size(); ++k)
    if (measured.data()[k] && ground.data()[k] > 0) logs.push_back(std::log(ground.data()[k]));
  if (logs.size() < 2) return 0;
  const auto [least, most] = std::ranges::minmax(logs);
  if (!(most > least)) return 0;
  struct Bin {
    double count = 0, sum = 0;
  };
  std::array<Bin, bins> histogram{};
  Bin all, below;
  for (const float x : logs) {
    Bin& bin = histogram[static_cast<std::size_t>((x - least) / (most - least) * (bins - 1))];
    bin.count += 1;
    bin.sum += x;
    all.sum += x;
  }
  all.count = static_cast<double>(logs.size());
  double best = 0, threshold = 0, contrast = 1;
  for (std::size_t k = 0; k + 1 < bins; ++k) {
    below.count += histogram[k].count;
    below.sum += histogram[k].sum;
    const double difference = (all.sum - below.sum) / (all.count - below.count) - below.sum / below.count;
    const double between = below.count * (all.count - below.count) * difference * difference;
    if (between > best) {
      best = between;
      threshold = least + (static_cast<double>(k) + 1) * (most - least) / (bins - 1);
      contrast = std::exp(-difference);
    }
  }
  return contrast < clear_contrast ? std::exp(threshold) : 0;
}

using Cell = std::array<int, 2>;

/// The rise from one cell to another of its row or column, as far as it is none that the slopes at two other cells and
/// all between them lead to [mm].
double unexplained_rise(const HeightField& field, Cell from, Cell to, Cell slope_from, Cell slope_to) {
  const Image<float>& slopes = from[0] == to[0] ? field.slope_q : field.slope_p;
  const double distance_mm = (to[0] - from[0] + to[1] - from[1]) * field.cell_mm;
  const double a = slopes(slope_from[0], slope_from[1]) * distance_mm,
               b = slopes(slope_to[0], slope_to[1]) * distance_mm;
  const double rise = field.z(to[0], to[1]) - field.z(from[0], from[1]);
  return rise - std::clamp(rise, std::min(a, b), std::max(a, b));
}

/// Cells of a mask without those on a step. The slopes beside a step explain it not, even where the fits make a ramp
/// of it.
Image<std::uint8_t> without_steps(const HeightField& field, const Image<std::uint8_t>& mask) {
  constexpr int half = 2, aside = 5;
  Image<std::uint8_t> level = mask;
  const auto is_step = [&](int i, int j, int di, int dj) {
    const Cell a{i - half * di, j - half * dj}, b{i + half * di, j + half * dj};
    Cell before{i - aside * di, j - aside * dj}, after{i + aside * di, j + aside * dj};
    const auto is_in = [&](const Cell& c) { return mask.contains(c[0], c[1]) && mask(c[0], c[1]); };
    if (!is_in(a) || !is_in(b)) return false;
    if (!is_in(before)) before = after;
    if (!is_in(before)) return false;
    if (!is_in(after)) after = before;
    return std::abs(unexplained_rise(field, a, b, before, after)) > cover_step_mm;
  };
  parallel_rows(mask.height(), [&](int j) {
    for (int i = 0; i < mask.width(); ++i)
      if (mask(i, j) && (is_step(i, j, 1, 0) || is_step(i, j, 0, 1))) level(i, j) = 0;
  });
  return level;
}

/// A connected piece of surface of one brightness class.
struct Piece {
  bool bright = true;
  std::vector<int> cells;                         // j * columns + i
  double middle_z = 0, lower_z = 0, upper_z = 0;  // median and quartiles [mm]
  double rim_outside = 0;                         // share of its rim that borders on nothing
  double drop_mm = 0;  // median of the paper's height minus its own along their common border
  int borders = 0;     // length of that border [cells]
  bool paper = false;
};

class Pieces {
 public:
  Pieces(const HeightField& field, const Image<std::uint8_t>& measured, const Image<std::uint8_t>& bright,
         double step = step_mm)
      : field_(field),
        measured_(measured),
        bright_(bright),
        step_mm_(step),
        inner_(field.columns(), field.rows(), 0),
        label_(field.columns(), field.rows(), -1) {
    parallel_rows(field.rows(), [&](int j) {
      for (int i = 0; i < field.columns(); ++i) inner_(i, j) = is_inner(i, j);
    });
    // One or two cells that happen to lead from a finger to the paper do not make them one piece. (The table's noise
    // may have holes all over: it stays one.)
    Image<std::uint8_t> broad = cores_of(inner_);
    for (std::size_t k = 0; k < broad.size(); ++k)
      if (!bright_.data()[k]) broad.data()[k] = inner_.data()[k];
    grow_all(broad);
    for (int round = 0; round < 2; ++round) widen_pieces();
    grow_all(inner_);
    for (Piece& piece : pieces_) note_heights(piece);
  }

  /// \param times_smaller  than the largest bright piece another one may be
  Image<std::uint8_t> choose_paper(std::size_t times_smaller) {
    choose_bright_pieces(times_smaller);
    for (Piece& piece : pieces_)
      if (!piece.bright) look_at_rim(piece);
    for (Piece& piece : pieces_)
      if (!piece.bright) piece.paper = is_printed(piece);
    Image<std::uint8_t> paper(field_.columns(), field_.rows(), 0);
    for (const Piece& piece : pieces_)
      for (const int k : piece.cells) paper.data()[k] = piece.paper;
    return with_edges(paper);
  }

  /// Cells of the small pieces that lie on the large ones: they are higher all around.
  Image<std::uint8_t> choose_cover() {
    std::size_t largest = 0;
    for (const Piece& piece : pieces_) largest = std::max(largest, piece.cells.size());
    for (Piece& piece : pieces_) piece.paper = piece.cells.size() * 10 >= largest;
    Image<std::uint8_t> cover(field_.columns(), field_.rows(), 0);
    for (Piece& piece : pieces_) {
      if (piece.paper) continue;
      if (static_cast<double>(piece.cells.size()) * field_.cell_mm * field_.cell_mm > least_cover_mm2 &&
          step_up_to(piece) > cover_step_mm)
        for (const int k : piece.cells) cover.data()[k] = 1;
    }
    return cover;
  }

 private:
  static constexpr std::array<std::pair<int, int>, 4> neighbours{{{1, 0}, {-1, 0}, {0, 1}, {0, -1}}};

  /// Whether the surface goes on from one cell to its neighbour: the height between them changes as the slope on either
  /// side says, or as both together do.
  bool joined(int i, int j, int i2, int j2) const {
    const Image<float>& slopes = i == i2 ? field_.slope_q : field_.slope_p;
    const double distance_mm = (i2 - i + j2 - j) * field_.cell_mm;
    const double rise = field_.z(i2, j2) - field_.z(i, j);
    const double here = std::clamp<double>(slopes(i, j), -steepest, steepest);
    const double there = std::clamp<double>(slopes(i2, j2), -steepest, steepest);
    return std::ranges::any_of(std::array{here, 0.5 * (here + there), there},
                               [&](double slope) { return std::abs(rise - slope * distance_mm) < step_mm_; });
  }

  /// Whether the fitted height is that of the cell's own points; the corner of an edge may be fitted as a ramp.
  bool is_fitted_well(int i, int j) const {
    const CellMean& cell = field_.cells(i, j);
    const double height = field_.z(i, j) + field_.slope_p(i, j) * cell.p + field_.slope_q(i, j) * cell.q;
    return cell.count == 0 || std::abs(cell.z - height) < 0.5 * step_mm_;
  }

  /// Whether the surface goes on to all sides that are measured. Pieces grow through such cells only: a few cells of
  /// middling height along an edge would connect what lies on either side of it.
  bool is_inner(int i, int j) const {
    return measured_(i, j) && is_fitted_well(i, j) && std::ranges::all_of(neighbours, [&](const auto& step) {
             const int i2 = i + step.first, j2 = j + step.second;
             return !measured_.contains(i2, j2) || !measured_(i2, j2) || joined(i, j, i2, j2);
           });
  }

  /// The paper and the cells at its edge that go on from it.
  Image<std::uint8_t> with_edges(const Image<std::uint8_t>& paper) const {
    Image<std::uint8_t> whole = paper;
    for (int j = 0; j < field_.rows(); ++j)
      for (int i = 0; i < field_.columns(); ++i) {
        if (!measured_(i, j) || label_(i, j) >= 0) continue;
        for (const auto& [di, dj] : neighbours)
          if (paper.contains(i + di, j + dj) && paper(i + di, j + dj) && joined(i, j, i + di, j + dj)) whole(i, j) = 1;
      }
    return whole;
  }

  /// Cells whose eight neighbours are in the mask too.
  static Image<std::uint8_t> cores_of(const Image<std::uint8_t>& mask) {
    Image<std::uint8_t> cores(mask.width(), mask.height(), 0);
    for (int j = 1; j + 1 < mask.height(); ++j)
      for (int i = 1; i + 1 < mask.width(); ++i) {
        cores(i, j) = 1;
        for (int dj = -1; dj <= 1; ++dj)
          for (int di = -1; di <= 1; ++di) cores(i, j) &= mask(i + di, j + dj);
      }
    return cores;
  }

  bool is_one_surface(int i, int j, int i2, int j2) const {
    return bright_(i, j) == bright_(i2, j2) && joined(i, j, i2, j2);
  }

  /// Makes a piece of all that is connected through cells of `way` and has no piece yet.
  void grow_all(const Image<std::uint8_t>& way) {
    for (int j = 0; j < field_.rows(); ++j)
      for (int i = 0; i < field_.columns(); ++i)
        if (label_(i, j) < 0 && way(i, j)) grow(i, j, way);
  }

  void grow(int i0, int j0, const Image<std::uint8_t>& way) {
    const int number = static_cast<int>(pieces_.size());
    Piece piece;
    piece.bright = bright_(i0, j0) != 0;
    piece.cells.push_back(j0 * field_.columns() + i0);
    label_(i0, j0) = number;
    for (std::size_t n = 0; n < piece.cells.size(); ++n) {
      const int i = piece.cells[n] % field_.columns(), j = piece.cells[n] / field_.columns();
      for (const auto& [di, dj] : neighbours) {
        const int i2 = i + di, j2 = j + dj;
        if (!way.contains(i2, j2) || !way(i2, j2) || label_(i2, j2) >= 0 || !is_one_surface(i, j, i2, j2)) continue;
        label_(i2, j2) = number;
        piece.cells.push_back(j2 * field_.columns() + i2);
      }
    }
    pieces_.push_back(std::move(piece));
  }

  /// Gives the inner cells beside a piece to it.
  void widen_pieces() {
    const Image<int> before = label_;
    for (int j = 0; j < field_.rows(); ++j)
      for (int i = 0; i < field_.columns(); ++i) {
        if (before(i, j) >= 0 || !inner_(i, j)) continue;
        for (const auto& [di, dj] : neighbours) {
          const int i2 = i + di, j2 = j + dj;
          if (!before.contains(i2, j2) || before(i2, j2) < 0 || !is_one_surface(i2, j2, i, j)) continue;
          label_(i, j) = before(i2, j2);
          pieces_[static_cast<std::size_t>(label_(i, j))].cells.push_back(j * field_.columns() + i);
          break;
        }
      }
  }

  void note_heights(Piece& piece) const {
    std::vector<float> heights;
    for (const int k : piece.cells) heights.push_back(field_.z.data()[k]);
    const auto quantile = [&](std::size_t quarters) {
      const auto at = heights.begin() + static_cast<std::ptrdiff_t>(heights.size() * quarters / 4);
      std::ranges::nth_element(heights, at);
      return *at;
    };
    piece.lower_z = quantile(1);
    piece.middle_z = quantile(2);
    piece.upper_z = quantile(3);
  }

  /// The largest bright piece and what is comparable to it, but not a level ground well below it.
  void choose_bright_pieces(std::size_t times_smaller) {
    const Piece* largest = nullptr;
    for (const Piece& piece : pieces_)
      if (piece.bright && (!largest || piece.cells.size() > largest->cells.size())) largest = &piece;
    if (!largest) return;
    const auto is_ground = [](const Piece& piece) { return piece.upper_z - piece.lower_z < table_flatness_mm; };
    // A white table may be larger than the book that lies on it.
    for (const Piece& piece : pieces_)
      if (piece.bright && is_ground(*largest) && piece.cells.size() * 10 > largest->cells.size() &&
          piece.lower_z > largest->middle_z + table_depth_mm)
        largest = &piece;
    for (Piece& piece : pieces_) {
      const bool below = is_ground(piece) && piece.middle_z < largest->lower_z - table_depth_mm;
      piece.paper =
          piece.bright && piece.cells.size() * times_smaller >= largest->cells.size() && (!below || &piece == largest);
    }
  }

  void look_at_rim(Piece& piece) {
    std::vector<float> drops;
    int rim = 0, outside = 0;
    for (const int k : piece.cells) {
      const int i = k % field_.columns(), j = k / field_.columns();
      for (const auto& [di, dj] : neighbours) {
        const int i2 = i + 3 * di, j2 = j + 3 * dj;  // a cell on the edge itself sees both sides
        const bool beyond = !label_.contains(i2, j2) || !measured_(i2, j2);
        const int other = beyond ? -1 : label_(i2, j2);
        if (other == label_(i, j)) continue;
        ++rim;
        if (beyond) ++outside;
        if (other >= 0 && pieces_[static_cast<std::size_t>(other)].paper)
          drops.push_back(field_.z(i2, j2) - field_.z(i, j));
      }
    }
    piece.rim_outside = rim > 0 ? static_cast<double>(outside) / rim : 0;
    piece.borders = static_cast<int>(drops.size());
    if (drops.empty()) return;
    std::ranges::nth_element(drops, drops.begin() + static_cast<std::ptrdiff_t>(drops.size() / 2));
    piece.drop_mm = drops[drops.size() / 2];
  }

  /// By how much a piece is higher than the paper around it beyond what the slopes on either side explain: the median
  /// over its rim [mm]; 0 if it has none.
  double step_up_to(const Piece& piece) const {
    constexpr int shortest = 3, longest = 8;  // across the cells of the step itself
    std::vector<double> steps;
    for (const int k : piece.cells) {
      const int i = k % field_.columns(), j = k / field_.columns();
      for (const auto& [di, dj] : neighbours)
        for (int reach = shortest; reach <= longest; ++reach) {
          const int i2 = i + reach * di, j2 = j + reach * dj;
          if (!label_.contains(i2, j2) || label_(i2, j2) == label_(i, j)) break;
          if (label_(i2, j2) < 0 || !pieces_[static_cast<std::size_t>(label_(i2, j2))].paper) continue;
          steps.push_back(-unexplained_rise(field_, {i, j}, {i2, j2}, {i, j}, {i2, j2}));
          break;
        }
    }
    if (steps.empty()) return 0;
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::ranges::nth_element(steps, middle);
    return *middle;
  }

  bool is_printed(const Piece& piece) const {
    if (piece.borders == 0 || step_up_to(piece) > step_mm_) return false;
    if (piece.rim_outside < 0.02) return true;
    return piece.drop_mm < edge_drop_mm && sides_framed(piece) < 2;
  }

  /// On how many of its four sides the bright paper has this piece beside at least half of its length.
  int sides_framed(const Piece& piece) const {
    int i0 = field_.columns(), i1 = 0, j0 = field_.rows(), j1 = 0;
    for (const Piece& other : pieces_)
      if (other.paper && other.bright)
        for (const int k : other.cells) {
          const int i = k % field_.columns(), j = k / field_.columns();
          i0 = std::min(i0, i);
          i1 = std::max(i1, i);
          j0 = std::min(j0, j);
          j1 = std::max(j1, j);
        }
    std::vector<char> left(static_cast<std::size_t>(field_.rows()), 0), right = left;
    std::vector<char> below(static_cast<std::size_t>(field_.columns()), 0), above = below;
    for (const int k : piece.cells) {
      const int i = k % field_.columns(), j = k / field_.columns();
      const auto column = static_cast<std::size_t>(i), row = static_cast<std::size_t>(j);
      if (j >= j0 && j <= j1 && i < i0) left[row] = 1;
      if (j >= j0 && j <= j1 && i > i1) right[row] = 1;
      if (i >= i0 && i <= i1 && j < j0) below[column] = 1;
      if (i >= i0 && i <= i1 && j > j1) above[column] = 1;
    }
    const auto framed = [](const std::vector<char>& side, int length) {
      return 2 * std::ranges::count(side, 1) > length ? 1 : 0;
    };
    return framed(left, j1 - j0) + framed(right, j1 - j0) + framed(below, i1 - i0) + framed(above, i1 - i0);
  }

  const HeightField& field_;
  const Image<std::uint8_t>& measured_;
  const Image<std::uint8_t>& bright_;
  double step_mm_;
  Image<std::uint8_t> inner_;
  Image<int> label_;
  std::vector<Piece> pieces_;
};

/// Takes away the paper cells beside a measured cell that is none: they may hold points of both.
void trim_mixed_cells(Image<std::uint8_t>& paper, const Image<std::uint8_t>& measured) {
  const Image<std::uint8_t> before = paper;
  for (int j = 0; j < paper.height(); ++j)
    for (int i = 0; i < paper.width(); ++i)
      for (int dj = -1; dj <= 1; ++dj)
        for (int di = -1; di <= 1; ++di)
          if (before.contains(i + di, j + dj) && measured(i + di, j + dj) && !before(i + di, j + dj)) paper(i, j) = 0;
}

/// Whether a place beside the paper stands above it: higher than a near cell of paper, and than its slope leads to.
bool stands_above(const HeightField& field, const Image<std::uint8_t>& paper, int i, int j) {
  constexpr int reach = 4;
  for (int dj = -reach; dj <= reach; ++dj)
    for (int di = -reach; di <= reach; ++di) {
      const int i2 = i + di, j2 = j + dj;
      if (!paper.contains(i2, j2) || !paper(i2, j2)) continue;
      const double rise = field.z(i, j) - field.z(i2, j2);
      const double expected = -(di * field.slope_p(i2, j2) + dj * field.slope_q(i2, j2)) * field.cell_mm;
      if (rise - std::max(0.0, expected) > cover_step_mm) return true;
    }
  return false;
}

/// Adds those cells of a mask that have most of their 5 x 5 neighbours in it: nothing that stands on paper is as narrow
/// as a row of cells in the gutter.
void keep_broad(const Image<std::uint8_t>& mask, Image<std::uint8_t>& kept) {
  for (int j = 2; j + 2 < mask.height(); ++j)
    for (int i = 2; i + 2 < mask.width(); ++i) {
      if (!mask(i, j)) continue;
      int count = 0;
      for (int dj = -2; dj <= 2; ++dj)
        for (int di = -2; di <= 2; ++di) count += mask(i + di, j + dj);
      if (2 * count > 25) kept(i, j) = 1;
    }
}

/// Takes away what lies on the paper or stands beside it, and the cells around that, which may hold points of both.
void take_cover_away(const HeightField& field, const Image<std::uint8_t>& measured, Image<std::uint8_t>& paper) {
  constexpr int reach = 5;  // the cells of the step, and one
  const Image<std::uint8_t> whole = paper;
  const Image<std::uint8_t> level = without_steps(field, whole);
  Image<std::uint8_t> cover = Pieces(field, level, level, cover_step_mm).choose_cover();
  Image<std::uint8_t> beside(paper.width(), paper.height(), 0);
  parallel_rows(paper.height(), [&](int j) {
    for (int i = 0; i < paper.width(); ++i)
      beside(i, j) = measured(i, j) && !whole(i, j) && stands_above(field, whole, i, j);
  });
  keep_broad(beside, cover);
  for (int j = 0; j < paper.height(); ++j)
    for (int i = 0; i < paper.width(); ++i)
      if (cover(i, j))
        for (int dj = -reach; dj <= reach; ++dj)
          for (int di = -reach; di <= reach; ++di)
            if (paper.contains(i + di, j + dj)) paper(i + di, j + dj) = 0;
}

}  // namespace

Image<std::uint8_t> find_paper(const HeightField& field, bool small_sheets) {
  Image<std::uint8_t> measured(field.columns(), field.rows(), 0), bright = measured;
  for (std::size_t k = 0; k < measured.size(); ++k) measured.data()[k] = std::isfinite(field.z.data()[k]);
  const int reach = std::max(1, static_cast<int>(std::lround(print_mm / field.cell_mm)));
  const Image<float> ground = close_print(field.intensity, reach);
  const double threshold = split_brightness(ground, measured);
  for (std::size_t k = 0; k < bright.size(); ++k) bright.data()[k] = !(ground.data()[k] < threshold);
  Image<std::uint8_t> paper = Pieces(field, measured, bright).choose_paper(small_sheets ? 100 : 10);
  trim_mixed_cells(paper, measured);
  take_cover_away(field, measured, paper);
  return paper;
}

}  // namespace pagesweep
