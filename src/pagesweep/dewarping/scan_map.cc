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

/// Positions in the scan at every `pitch`-th pixel of the page and one node around it.
class Lattice {
 public:
  Lattice(const PaperView& view, const Occlusion& occlusion, const PageFrame& frame, double pixels_per_mm)
      : view_(view), occlusion_(occlusion), frame_(frame), pixels_per_mm_(pixels_per_mm) {
    // Three nodes from one node of the surface to the next see all that its spline does between them.
    pitch_ = static_cast<int>(std::clamp(view.surface().spacing_mm * pixels_per_mm / 3, 2.0, 16.0));
    columns_ = (frame.width_px(pixels_per_mm) - 1) / pitch_ + 1;
    rows_ = (frame.height_px(pixels_per_mm) - 1) / pitch_ + 1;
    nodes_ = Image<Eigen::Vector2d>(columns_ + 3, rows_ + 3, Eigen::Vector2d::Zero());
    seen_ = Image<char>(columns_ + 3, rows_ + 3, false);
    parallel_rows(nodes_.height(), [&](int j) {
      for (int i = 0; i < nodes_.width(); ++i) set_node(i, j);
    });
  }

  int pitch() const { return pitch_; }
  int columns() const { return columns_; }  ///< cells
  int rows() const { return rows_; }        ///< cells

  /// Whether the cell between nodes (i, j) and (i + 1, j + 1) is seen and interpolated within the tolerance.
  bool is_smooth(int i, int j, double tolerance_px) const {
    for (int b = 0; b < 4; ++b)
      for (int a = 0; a < 4; ++a)
        if (!nodes_(i + a, j + b).allFinite()) return false;
    if (!seen_(i + 1, j + 1) || !seen_(i + 2, j + 1) || !seen_(i + 1, j + 2) || !seen_(i + 2, j + 2)) return false;
    const auto middle = see((i + 0.5) * pitch_, (j + 0.5) * pitch_);
    return middle &&
           (interpolate_at(i, j, catmull_rom_weights(0.5), catmull_rom_weights(0.5)) - *middle).norm() <= tolerance_px;
  }

  Eigen::Vector2d interpolate_at(int i, int j, const Weights& wx, const Weights& wy) const {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (int b = 0; b < 4; ++b)
      for (int a = 0; a < 4; ++a)
        sum += wx[static_cast<std::size_t>(a)] * wy[static_cast<std::size_t>(b)] * nodes_(i + a, j + b);
    return sum;
  }

  /// The four lattice columns around cell (i, j), already interpolated along y: what a row of pixels needs.
  std::array<Eigen::Vector2d, 4> columns_at(int i, int j, const Weights& wy) const {
    std::array<Eigen::Vector2d, 4> columns;
    for (int a = 0; a < 4; ++a) {
      Eigen::Vector2d& sum = columns[static_cast<std::size_t>(a)] = Eigen::Vector2d::Zero();
      for (int b = 0; b < 4; ++b) sum += wy[static_cast<std::size_t>(b)] * nodes_(i + a, j + b);
    }
    return columns;
  }

  /// Page pixel (x, y) without interpolation; nothing if it is hidden.
  std::optional<Eigen::Vector2d> see(double x, double y) const {
    const Eigen::Vector2d paper = frame_.paper_at_pixel(x, y, pixels_per_mm_);
    const Eigen::Vector3d point = view_.point(paper);
    const auto pixel = view_.scanner().project(point);
    return pixel && is_seen(paper, point, *pixel) ? pixel : std::nullopt;
  }

 private:
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
  double pixels_per_mm_;
  int pitch_ = 1, columns_ = 0, rows_ = 0;
  Image<Eigen::Vector2d> nodes_;
  Image<char> seen_;
};

/// Fills the map's pixels of lattice cell (i, j).
void fill_cell(const Lattice& lattice, int i, int j, double tolerance_px, const std::vector<Weights>& weights,
               ScanMap& map) {
  const int pitch = lattice.pitch();
  const int x_end = std::min((i + 1) * pitch, map.width());
  const int y_end = std::min((j + 1) * pitch, map.height());
  const bool smooth = lattice.is_smooth(i, j, tolerance_px);
  for (int y = j * pitch; y < y_end; ++y) {
    const auto columns = lattice.columns_at(i, j, weights[static_cast<std::size_t>(y - j * pitch)]);
    for (int x = i * pitch; x < x_end; ++x) {
      const Weights& w = weights[static_cast<std::size_t>(x - i * pitch)];
      std::optional<Eigen::Vector2d> pixel;
      if (smooth)
        pixel = w[0] * columns[0] + w[1] * columns[1] + w[2] * columns[2] + w[3] * columns[3];
      else
        pixel = lattice.see(x, y);
      if (!pixel) continue;
      map.u(x, y) = static_cast<float>(pixel->x());
      map.v(x, y) = static_cast<float>(pixel->y());
    }
  }
}

}  // namespace

ScanMap build_scan_map(const PaperView& view, const Occlusion& occlusion, const PageFrame& frame, double pixels_per_mm,
                       double tolerance_px) {
  if (!(pixels_per_mm > 0) || !(tolerance_px > 0))
    throw std::invalid_argument("build_scan_map: pixels_per_mm and tolerance_px must be positive");
  const Lattice lattice(view, occlusion, frame, pixels_per_mm);
  std::vector<Weights> weights;
  for (int k = 0; k < lattice.pitch(); ++k) weights.push_back(catmull_rom_weights(double(k) / lattice.pitch()));
  ScanMap map(frame.width_px(pixels_per_mm), frame.height_px(pixels_per_mm));
  parallel_rows(lattice.rows(), [&](int j) {
    for (int i = 0; i < lattice.columns(); ++i) fill_cell(lattice, i, j, tolerance_px, weights, map);
  });
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
