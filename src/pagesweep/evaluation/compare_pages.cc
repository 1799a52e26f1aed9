// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/compare_pages.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <vector>

#include "pagesweep/base/parallel.h"
#include "pagesweep/evaluation/scan_map_inverse.h"

namespace pagesweep {
namespace {

/// One spot of paper: where it is on the true page and where on the result [mm], x right and y down.
struct Spot {
  Eigen::Vector2d truth, result;
};

/// The result turned and shifted onto the truth: truth = rotation(angle) result + shift.
struct Alignment {
  double angle_rad = 0;
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();

  Eigen::Vector2d turn(const Eigen::Vector2d& p) const {
    const double c = std::cos(angle_rad), s = std::sin(angle_rad);
    return {c * p.x() - s * p.y(), s * p.x() + c * p.y()};
  }
  Eigen::Vector2d operator*(const Eigen::Vector2d& p) const { return turn(p) + shift; }
};

Alignment align(const std::vector<Spot>& spots, const std::vector<double>& weights) {
  Eigen::Vector2d truth_middle = Eigen::Vector2d::Zero(), result_middle = truth_middle;
  double sum = 0;
  for (std::size_t i = 0; i < spots.size(); ++i) {
    truth_middle += weights[i] * spots[i].truth;
    result_middle += weights[i] * spots[i].result;
    sum += weights[i];
  }
  truth_middle /= sum;
  result_middle /= sum;
  double cosine = 0, sine = 0;
  for (std::size_t i = 0; i < spots.size(); ++i) {
    const Eigen::Vector2d p = spots[i].result - result_middle, q = spots[i].truth - truth_middle;
    cosine += weights[i] * p.dot(q);
    sine += weights[i] * (p.x() * q.y() - p.y() * q.x());
  }
  Alignment alignment{std::atan2(sine, cosine), {}};
  alignment.shift = truth_middle - alignment.turn(result_middle);
  return alignment;
}

/// Least squares with Huber's weights: a badly flattened corner must not turn the whole page.
Alignment align_robustly(const std::vector<Spot>& spots, std::vector<double>& weights) {
  weights.assign(spots.size(), 1);
  Alignment alignment = align(spots, weights);
  std::vector<double> sizes(spots.size());
  for (int round = 0; round < 10; ++round) {
    for (std::size_t i = 0; i < spots.size(); ++i) sizes[i] = (alignment * spots[i].result - spots[i].truth).norm();
    const double limit = 2 * median_of(sizes);
    if (!(limit > 0)) break;
    for (std::size_t i = 0; i < spots.size(); ++i) weights[i] = sizes[i] <= limit ? 1 : limit / sizes[i];
    alignment = align(spots, weights);
  }
  return alignment;
}

/// Scale errors from the best affine map truth -> aligned result.
void measure_scale(const std::vector<Spot>& spots, const std::vector<double>& weights, const Alignment& alignment,
                   PageErrors& errors) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 2> right = Eigen::Matrix<double, 3, 2>::Zero();
  const Eigen::Vector2d origin = spots[0].truth;
  for (std::size_t i = 0; i < spots.size(); ++i) {
    const Eigen::Vector3d terms(1, spots[i].truth.x() - origin.x(), spots[i].truth.y() - origin.y());
    normal += weights[i] * terms * terms.transpose();
    right += weights[i] * terms * (alignment * spots[i].result - spots[i].truth).transpose();
  }
  const Eigen::LDLT<Eigen::Matrix3d> factors(normal);
  if (!(factors.rcond() > 1e-12)) return;
  const Eigen::Matrix<double, 3, 2> map = factors.solve(right);
  errors.scale_error_x = map(1, 0);
  errors.scale_error_y = map(2, 1);
  errors.scale_error = 0.5 * (map(1, 0) + map(2, 1));
}

/// Finds spots of the true page on the result. Positions are millimetres from the page's upper left corner.
class SpotFinder {
 public:
  SpotFinder(const MappedPage& result, const MappedPage& truth)
      : result_(result), truth_(truth), inverse_(*result.map) {}

  double width_mm() const { return truth_.map->width() / truth_.pixels_per_mm; }
  double height_mm() const { return truth_.map->height() / truth_.pixels_per_mm; }
  std::optional<Eigen::Vector2d> scan_of(const Eigen::Vector2d& truth_mm) const {
    return scan_position(*truth_.map, (truth_mm * truth_.pixels_per_mm).array() - 0.5);
  }
  std::optional<Eigen::Vector2d> result_of(const Eigen::Vector2d& scan) const {
    const auto pixel = inverse_(scan);
    if (!pixel) return std::nullopt;
    return Eigen::Vector2d((pixel->array() + 0.5) / result_.pixels_per_mm);
  }

 private:
  MappedPage result_, truth_;
  ScanMapInverse inverse_;
};

struct Grid {
  Image<Eigen::Vector2d> result_mm;  ///< NaN where the spot is not found
  std::size_t visible = 0;           ///< spots that the scan shows
  std::size_t found = 0;
};

Grid find_grid(const SpotFinder& finder, double spacing_mm) {
  const Eigen::Vector2d nowhere = Eigen::Vector2d::Constant(not_a_number);
  Grid grid{
      {static_cast<int>(finder.width_mm() / spacing_mm), static_cast<int>(finder.height_mm() / spacing_mm), nowhere}};
  std::vector<std::size_t> visible(static_cast<std::size_t>(grid.result_mm.height()));
  parallel_rows(grid.result_mm.height(), [&](int j) {
    for (int i = 0; i < grid.result_mm.width(); ++i) {
      const auto scan = finder.scan_of(Eigen::Vector2d(i + 0.5, j + 0.5) * spacing_mm);
      if (!scan) continue;
      ++visible[static_cast<std::size_t>(j)];
      grid.result_mm(i, j) = finder.result_of(*scan).value_or(nowhere);
    }
  });
  for (const std::size_t row : visible) grid.visible += row;
  for (const Eigen::Vector2d& p : grid.result_mm.pixels()) grid.found += p.allFinite();
  return grid;
}

/// Deviations of (x, y) places from the straight line that fits best to them.
std::vector<double> straight_line_residuals(std::span<const Eigen::Vector2d> places) {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& p : places) middle += p / static_cast<double>(places.size());
  double xx = 0, xy = 0;
  for (const Eigen::Vector2d& p : places) {
    xx += (p.x() - middle.x()) * (p.x() - middle.x());
    xy += (p.x() - middle.x()) * (p.y() - middle.y());
  }
  const double slope = xx > 0 ? xy / xx : 0;
  std::vector<double> residuals;
  for (const Eigen::Vector2d& p : places)
    residuals.push_back((p.y() - middle.y() - slope * (p.x() - middle.x())) / std::hypot(1, slope));
  return residuals;
}

double largest(const std::vector<double>& values) {
  double size = 0;
  for (const double value : values) size = std::max(size, std::abs(value));
  return size;
}

/// Follows text lines of the true page on the aligned result.
void judge_lines(const SpotFinder& finder, const Alignment& alignment, const PageComparisonOptions& options,
                 PageErrors& errors) {
  constexpr double step_mm = 1;
  std::vector<double> deviations;
  double in_window = -1;
  for (double y = 0.5 * options.line_spacing_mm; y < finder.height_mm(); y += options.line_spacing_mm) {
    std::vector<Eigen::Vector2d> places;
    for (double x = 0.5 * step_mm; x < finder.width_mm(); x += step_mm)
      if (const auto scan = finder.scan_of({x, y}))
        if (const auto result = finder.result_of(*scan)) places.push_back(alignment * *result);
    if (places.size() < 10) continue;
    const std::vector<double> line = straight_line_residuals(places);
    deviations.insert(deviations.end(), line.begin(), line.end());
    const auto window = std::min(places.size(), static_cast<std::size_t>(options.line_window_mm / step_mm));
    for (std::size_t from = 0; from + window <= places.size(); from += std::max<std::size_t>(1, window / 10))
      in_window = std::max(in_window, largest(straight_line_residuals(std::span(places).subspan(from, window))));
  }
  errors.line_deviation = summarise(std::move(deviations));
  if (in_window >= 0) errors.line_deviation_in_window = in_window;
}

}  // namespace

PageErrors compare_pages(const MappedPage& result, const MappedPage& truth, const PageComparisonOptions& options) {
  if (!result.map || !truth.map || !(result.pixels_per_mm > 0) || !(truth.pixels_per_mm > 0))
    throw std::invalid_argument("compare_pages: a page needs a scan map and a positive scale");
  if (!(options.grid_mm > 0) || !(options.line_spacing_mm > 0) || !(options.line_window_mm >= 2))
    throw std::invalid_argument("compare_pages: the options' lengths must be positive");
  const SpotFinder finder(result, truth);
  const Grid grid = find_grid(finder, options.grid_mm);
  PageErrors errors;
  errors.spacing_mm = options.grid_mm;
  errors.displacements =
      Image<Eigen::Vector2f>(grid.result_mm.width(), grid.result_mm.height(), Eigen::Vector2f::Constant(not_a_number));
  if (grid.visible > 0) errors.covered = static_cast<double>(grid.found) / static_cast<double>(grid.visible);
  if (grid.found < 3) return errors;
  const auto truth_at = [&](int i, int j) -> Eigen::Vector2d {
    return Eigen::Vector2d(i + 0.5, j + 0.5) * options.grid_mm;
  };
  std::vector<Spot> spots;
  for (int j = 0; j < grid.result_mm.height(); ++j)
    for (int i = 0; i < grid.result_mm.width(); ++i)
      if (grid.result_mm(i, j).allFinite()) spots.push_back({truth_at(i, j), grid.result_mm(i, j)});
  std::vector<double> weights, sizes;
  const Alignment alignment = align_robustly(spots, weights);
  for (int j = 0; j < grid.result_mm.height(); ++j)
    for (int i = 0; i < grid.result_mm.width(); ++i) {
      if (!grid.result_mm(i, j).allFinite()) continue;
      const Eigen::Vector2d displacement = alignment * grid.result_mm(i, j) - truth_at(i, j);
      errors.displacements(i, j) = displacement.cast<float>();
      sizes.push_back(displacement.norm());
    }
  errors.displacement = summarise(std::move(sizes));
  errors.rotation_rad = -alignment.angle_rad;
  errors.shift_mm = alignment.shift;
  measure_scale(spots, weights, alignment, errors);
  judge_lines(finder, alignment, options, errors);
  return errors;
}

}  // namespace pagesweep
