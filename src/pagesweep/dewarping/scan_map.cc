// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/scan_map.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "pagesweep/base/catmull_rom.h"
#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

using Weights = std::array<double, 4>;

constexpr int largest_pitch = 16;  // [page pixels]

/// Positions in the scan at every `pitch`-th pixel of the page and one node around it.
class Lattice {
 public:
  Lattice(const PaperView& view, const Occlusion& occlusion, const PageFrame& frame, double pixels_per_mm,
          double tolerance_px)
      : view_(view), occlusion_(occlusion), frame_(frame), pixels_per_mm_(pixels_per_mm), tolerance_px_(tolerance_px) {
    // Two nodes from one node of the surface to the next see what its spline does between them; where that is too much
    // for this lattice, the middle of a cell shows it.
    pitch_ = static_cast<int>(
        std::clamp(view.surface().spacing_mm * pixels_per_mm / 2, 2.0, static_cast<double>(largest_pitch)));
    columns_ = (frame.width_px(pixels_per_mm) - 1) / pitch_ + 1;
    rows_ = (frame.height_px(pixels_per_mm) - 1) / pitch_ + 1;
    nodes_ = Image<Eigen::Vector2d>(columns_ + 3, rows_ + 3, Eigen::Vector2d::Zero());
    seen_ = Image<char>(columns_ + 3, rows_ + 3, false);
    parallel_rows(nodes_.height(), [&](int j) {
      for (int i = 0; i < nodes_.width(); ++i) set_node(i, j);
    });
    even_along_ = even_down_ = Image<char>(columns_ + 3, rows_ + 3, false);
    parallel_rows(nodes_.height(), [&](int j) {
      for (int i = 0; i + 3 < nodes_.width(); ++i) even_along_(i, j) = is_even(i, j, 1, 0);
      if (j + 3 < nodes_.height())
        for (int i = 0; i < nodes_.width(); ++i) even_down_(i, j) = is_even(i, j, 0, 1);
    });
  }

  int pitch() const { return pitch_; }
  int columns() const { return columns_; }  ///< cells
  int rows() const { return rows_; }        ///< cells

  /// Whether the cell between nodes (i, j) and (i + 1, j + 1) is seen and interpolated within the tolerance.
  bool is_smooth(int i, int j) const {
    if (!seen_(i + 1, j + 1) || !seen_(i + 2, j + 1) || !seen_(i + 1, j + 2) || !seen_(i + 2, j + 2)) return false;
    if (is_bent_evenly(i, j)) return true;
    for (int b = 0; b < 4; ++b)
      for (int a = 0; a < 4; ++a)
        if (!nodes_(i + a, j + b).allFinite()) return false;
    const auto middle = see((i + 0.5) * pitch_, (j + 0.5) * pitch_);
    return middle &&
           (interpolate_at(i, j, catmull_rom_weights(0.5), catmull_rom_weights(0.5)) - *middle).norm() <= tolerance_px_;
  }

  Eigen::Vector2d interpolate_at(int i, int j, const Weights& wx, const Weights& wy) const {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (int b = 0; b < 4; ++b)
      for (int a = 0; a < 4; ++a)
        sum += wx[static_cast<std::size_t>(a)] * wy[static_cast<std::size_t>(b)] * nodes_(i + a, j + b);
    return sum;
  }

  /// A row of pixels of cells (., j): the lattice, already interpolated along y.
  void interpolate_row(int j, const Weights& wy, std::vector<Eigen::Vector2d>& row) const {
    row.resize(static_cast<std::size_t>(nodes_.width()));
    for (int i = 0; i < nodes_.width(); ++i)
      row[static_cast<std::size_t>(i)] =
          wy[0] * nodes_(i, j) + wy[1] * nodes_(i, j + 1) + wy[2] * nodes_(i, j + 2) + wy[3] * nodes_(i, j + 3);
  }

  /// Page pixel (x, y) without interpolation; nothing if it is hidden.
  std::optional<Eigen::Vector2d> see(double x, double y) const {
    const Eigen::Vector2d paper = frame_.paper_at_pixel(x, y, pixels_per_mm_);
    const Eigen::Vector3d point = view_.point(paper);
    const auto pixel = view_.scanner().project(point);
    return pixel && is_seen(paper, point, *pixel) ? pixel : std::nullopt;
  }

 private:
  /// Whether the third differences of the nodes around a cell are within the tolerance. A cubic between nodes errs by
  /// an eighth of them at most, so that the middle need not be asked.
  bool is_bent_evenly(int i, int j) const {
    bool even = true;
    for (int k = 0; k < 4; ++k) even &= even_along_(i, j + k) && even_down_(i + k, j);
    return even;
  }

  /// Whether the third difference of four nodes, from (i, j) on, is within the tolerance; not if one is not a number.
  bool is_even(int i, int j, int di, int dj) const {
    const Eigen::Vector2d third =
        nodes_(i + 3 * di, j + 3 * dj) - nodes_(i, j) + 3 * (nodes_(i + di, j + dj) - nodes_(i + 2 * di, j + 2 * dj));
    return std::abs(third.x()) < tolerance_px_ && std::abs(third.y()) < tolerance_px_;
  }

  bool is_seen(const Eigen::Vector2d& paper, const Eigen::Vector3d& point, const Eigen::Vector2d& pixel) const {
    return view_.is_on_page(paper) && view_.scanner().sees(pixel) && !occlusion_.hides(view_.scanner(), point, pixel);
  }

  void set_node(int i, int j) {
    const Eigen::Vector2d paper = frame_.paper_at_pixel((i - 1) * pitch_, (j - 1) * pitch_, pixels_per_mm_);
    const Eigen::Vector3d point = view_.point(paper);
    const auto pixel = view_.scanner().project(point);
    nodes_(i, j) = pixel ? *pixel : Eigen::Vector2d::Constant(not_a_number);
    seen_(i, j) = pixel && is_seen(paper, point, *pixel);
  }

  const PaperView& view_;
  const Occlusion& occlusion_;
  const PageFrame& frame_;
  double pixels_per_mm_, tolerance_px_;
  int pitch_ = 1, columns_ = 0, rows_ = 0;
  Image<Eigen::Vector2d> nodes_;
  Image<char> seen_;
  Image<char> even_along_, even_down_;  ///< of four nodes each, at the first of them
};

/// The Catmull-Rom cubic between the second and third of four samples, at k / pitch for k = 0 ... count - 1.
/// In float, what is large must come last.
template <int count>
void fill_cubic(const std::array<double, 4>& p, float step, float* out) {
  const auto c0 = static_cast<float>(p[1]), c1 = static_cast<float>(0.5 * (p[2] - p[0]));
  const auto c2 = static_cast<float>(p[0] - 2.5 * p[1] + 2 * p[2] - 0.5 * p[3]);
  const auto c3 = static_cast<float>(0.5 * (p[3] - p[0]) + 1.5 * (p[1] - p[2]));
  for (int k = 0; k < count; ++k) {
    const float x = static_cast<float>(k) * step;
    out[k] = c0 + x * (c1 + x * (c2 + x * c3));
  }
}

/// The same for all pixels of a cell, and some beyond: loops of known length become vectors.
void fill_cell(const std::array<double, 4>& p, int pitch, float* out) {
  const float step = 1 / static_cast<float>(pitch);
  pitch <= largest_pitch / 2 ? fill_cubic<largest_pitch / 2>(p, step, out) : fill_cubic<largest_pitch>(p, step, out);
}

/// Fills the map's pixels in the j-th row of lattice cells.
void fill_cells(const Lattice& lattice, int j, ScanMap& map) {
  const int pitch = lattice.pitch();
  std::vector<char> smooth(static_cast<std::size_t>(lattice.columns()));
  for (int i = 0; i < lattice.columns(); ++i) smooth[static_cast<std::size_t>(i)] = lattice.is_smooth(i, j);
  std::vector<Eigen::Vector2d> row;
  std::vector<float> u(static_cast<std::size_t>(lattice.columns() * pitch + largest_pitch)), v = u;
  for (int y = j * pitch; y < std::min((j + 1) * pitch, map.height()); ++y) {
    lattice.interpolate_row(j, catmull_rom_weights(double(y - j * pitch) / pitch), row);
    for (int i = 0; i < lattice.columns(); ++i) {
      const auto begin = static_cast<std::size_t>(i * pitch), end = begin + static_cast<std::size_t>(pitch);
      if (smooth[static_cast<std::size_t>(i)]) {  // what it writes beyond the cell is the next one's
        const Eigen::Vector2d* p = &row[static_cast<std::size_t>(i)];
        fill_cell({p[0].x(), p[1].x(), p[2].x(), p[3].x()}, pitch, &u[begin]);
        fill_cell({p[0].y(), p[1].y(), p[2].y(), p[3].y()}, pitch, &v[begin]);
        continue;
      }
      for (std::size_t x = begin; x < end; ++x) {
        const auto pixel = lattice.see(static_cast<double>(x), y);
        u[x] = pixel ? static_cast<float>(pixel->x()) : not_a_number;
        v[x] = pixel ? static_cast<float>(pixel->y()) : not_a_number;
      }
    }
    std::copy_n(u.begin(), map.width(), map.u.row(y).begin());
    std::copy_n(v.begin(), map.width(), map.v.row(y).begin());
  }
}

}  // namespace

ScanMap build_scan_map(const PaperView& view, const Occlusion& occlusion, const PageFrame& frame, double pixels_per_mm,
                       double tolerance_px) {
  if (!(pixels_per_mm > 0) || !(tolerance_px > 0))
    throw std::invalid_argument("build_scan_map: pixels_per_mm and tolerance_px must be positive");
  const Lattice lattice(view, occlusion, frame, pixels_per_mm, tolerance_px);
  ScanMap map(frame.width_px(pixels_per_mm), frame.height_px(pixels_per_mm));
  parallel_rows(lattice.rows(), [&](int j) { fill_cells(lattice, j, map); });
  return map;
}

double scan_pixels_per_mm(const PaperView& view, const PageFrame& frame) {
  constexpr int steps = 20;
  constexpr double h_mm = 0.5;
  std::vector<double> scales;
  for (int j = 1; j < steps; ++j)
    for (int i = 1; i < steps; ++i) {
      const Eigen::Vector2d paper = frame.paper_from_page({frame.width_mm * i / steps, frame.height_mm * j / steps});
      const auto at = view.position(paper);
      const auto right = view.position(paper + h_mm * frame.right());
      const auto down = view.position(paper + h_mm * frame.down());
      if (!at || !right || !down || !view.scanner().sees(*at)) continue;
      Eigen::Matrix2d scan_by_page;
      scan_by_page << *right - *at, *down - *at;
      scales.push_back(std::sqrt(std::abs(scan_by_page.determinant())) / h_mm);
    }
  if (scales.empty())
    throw no_result("the scan shows no part of the page: does the rig's scanner belong to this scan?");
  const auto middle = scales.begin() + static_cast<std::ptrdiff_t>(scales.size() / 2);
  std::nth_element(scales.begin(), middle, scales.end());
  return *middle;
}

}  // namespace pagesweep
