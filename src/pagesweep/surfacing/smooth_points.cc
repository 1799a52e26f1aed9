// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/smooth_points.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"

namespace pagesweep {

Eigen::Vector3d PlanFrame::plan_from_rig(const Eigen::Vector3d& rig) const {
  return Eigen::AngleAxisd(-angle_rad, Eigen::Vector3d::UnitZ()) * rig;
}

Eigen::Vector3d PlanFrame::rig_from_plan(const Eigen::Vector3d& plan) const {
  return Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitZ()) * plan;
}

CellMean mean_of(std::span<const PlanPoint> points, double p_mm, double q_mm) {
  double w = 0, p = 0, q = 0, z = 0, pp = 0, pq = 0, qq = 0, intensity = 0;
  for (const PlanPoint& point : points) {
    const double weight = 1 / (static_cast<double>(point.sigma) * point.sigma);
    const double u = point.p - p_mm, v = point.q - q_mm;
    w += weight;
    p += weight * u;
    q += weight * v;
    z += weight * point.z;
    pp += weight * u * u;
    pq += weight * u * v;
    qq += weight * v * v;
    intensity += point.intensity;
  }
  if (points.empty()) return {};
  p /= w;
  q /= w;
  const auto narrow = [](double x) { return static_cast<float>(x); };
  return {narrow(p),
          narrow(q),
          narrow(z / w),
          narrow(pp / w - p * p),
          narrow(pq / w - p * q),
          narrow(qq / w - q * q),
          narrow(w),
          narrow(intensity / static_cast<double>(points.size())),
          static_cast<int>(points.size())};
}

namespace {

constexpr std::size_t fewest_points = 30;
constexpr double outlier_sigmas = 5;
constexpr double edge_scatter = 2.5;  // residuals of so many times the noise are more than noise
constexpr int first_pass_step = 2;    // [cells] the first fits need not be dense
constexpr double largest_field_cells = 4e6;

/// Whether a pixel has a point that can be used.
bool has_point(const PointMap& map, int x, int y) {
  return map.status(x, y) == PixelStatus::ok && std::isfinite(map.x(x, y) + map.y(x, y) + map.z(x, y)) &&
         map.sigma(x, y) > 0 && std::isfinite(map.sigma(x, y));
}

/// How many points the rows above each row of pixels have, and all.
std::vector<std::size_t> count_points(const PointMap& map) {
  std::vector<std::size_t> above(static_cast<std::size_t>(map.height()) + 1, 0);
  parallel_rows(map.height(), [&](int y) {
    std::size_t count = 0;
    for (int x = 0; x < map.width(); ++x) count += has_point(map, x, y);
    above[static_cast<std::size_t>(y) + 1] = count;
  });
  for (std::size_t y = 0; y + 1 < above.size(); ++y) above[y + 1] += above[y];
  return above;
}

/// The points of one camera, in the order of its pixels.
void place_points(const PointMap& map, const std::vector<std::size_t>& above, const PlanFrame& frame,
                  PlanPoint* points) {
  const double c = std::cos(frame.angle_rad), s = std::sin(frame.angle_rad);
  parallel_rows(map.height(), [&](int y) {
    PlanPoint* point = points + above[static_cast<std::size_t>(y)];
    for (int x = 0; x < map.width(); ++x) {
      if (!has_point(map, x, y)) continue;
      const double px = map.x(x, y), py = map.y(x, y);
      *point++ = {static_cast<float>(c * px + s * py), static_cast<float>(c * py - s * px), map.z(x, y),
                  std::max(map.sigma(x, y), 1e-3f), map.intensity(x, y)};
    }
  });
}

std::vector<PlanPoint> gather_points(std::span<const PointMap> cameras, const PlanFrame& frame) {
  std::vector<std::vector<std::size_t>> counts;
  std::size_t count = 0;
  for (const PointMap& map : cameras) count += counts.emplace_back(count_points(map)).back();
  std::vector<PlanPoint> points(count);
  PlanPoint* next = points.data();
  for (std::size_t c = 0; c < cameras.size(); next += counts[c++].back())
    place_points(cameras[c], counts[c], frame, next);
  return points;
}

/// Bounds that a few stray points do not blow up: 0.2 % may lie beyond them, widened by a twentieth.
std::pair<double, double> bounds_of(const std::vector<PlanPoint>& points, float PlanPoint::* coordinate) {
  std::vector<float> values;
  const std::size_t stride = std::max<std::size_t>(1, points.size() / 200000);
  for (std::size_t i = 0; i < points.size(); i += stride) values.push_back(points[i].*coordinate);
  const auto place = [&](double share) {
    return values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  };
  const auto at_low = place(0.002), at_high = place(0.998);
  std::nth_element(values.begin(), at_low, values.end());
  const double low = *at_low;
  std::nth_element(at_low, at_high, values.end());
  const double high = *at_high;
  const double slack = 0.05 * (high - low) + 1;
  return {low - slack, high + slack};
}

/// Cells of such a size that the occupied ones hold about four points.
double choose_cell_mm(const std::vector<PlanPoint>& points, double p0, double p1, double q0, double q1) {
  const double block = std::max(4.0, std::sqrt((p1 - p0) * (q1 - q0) / largest_field_cells));
  const int columns = static_cast<int>((p1 - p0) / block) + 1, rows = static_cast<int>((q1 - q0) / block) + 1;
  constexpr int shares = 8;
  const int count = static_cast<int>(points.size()), grain = count / shares + 1;
  Image<std::uint8_t> by_share(columns * rows, shares);
  parallel_ranges(count, grain, [&](int begin, int end) {
    for (int n = begin; n < end; ++n) {
      const PlanPoint& point = points[static_cast<std::size_t>(n)];
      const int i = static_cast<int>((point.p - p0) / block), j = static_cast<int>((point.q - q0) / block);
      if (i >= 0 && j >= 0 && i < columns && j < rows) by_share(j * columns + i, begin / grain) = 1;
    }
  });
  Image<std::uint8_t> occupied(columns * rows, 1);
  for (int share = 0; share < shares; ++share)
    for (int k = 0; k < occupied.width(); ++k) occupied(k, 0) |= by_share(k, share);
  const auto blocks = std::max<std::ptrdiff_t>(1, std::ranges::count(occupied.pixels(), 1));
  const double density = static_cast<double>(points.size()) / (static_cast<double>(blocks) * block * block);
  const double smallest = std::sqrt((p1 - p0) * (q1 - q0) / largest_field_cells);
  // Sparse points: one a cell must do, so that the neighbourhood, which has at least 2.5 cells, still holds twenty.
  const double largest = std::max(2.0, std::sqrt(1 / density));
  return std::max(std::clamp(std::sqrt(4 / density), 1.0, largest), smallest);
}

HeightField empty_field(const std::vector<PlanPoint>& points, const SmoothingOptions& options) {
  std::array<std::pair<double, double>, 2> bounds;
  parallel_rows(2, [&](int k) {
    bounds[static_cast<std::size_t>(k)] = bounds_of(points, k == 0 ? &PlanPoint::p : &PlanPoint::q);
  });
  const auto [p0, p1] = bounds[0];
  const auto [q0, q1] = bounds[1];
  HeightField field;
  field.frame.angle_rad = options.reading_direction_rad;
  field.cell_mm = options.cell_mm > 0 ? options.cell_mm : choose_cell_mm(points, p0, p1, q0, q1);
  field.p0_mm = p0;
  field.q0_mm = q0;
  const int columns = static_cast<int>((p1 - p0) / field.cell_mm) + 2;
  const int rows = static_cast<int>((q1 - q0) / field.cell_mm) + 2;
  field.cells = Image<CellMean>(columns, rows);
  field.z = field.sigma = field.intensity = field.slope_p = field.slope_q = Image<float>(columns, rows, not_a_number);
  field.status = Image<PixelStatus>(columns, rows, PixelStatus::not_computed);
  field.points = static_cast<std::int64_t>(points.size());
  return field;
}

/// Counting sort. Each share of the points is counted on its own, so that shares can be put in place side by side, and
/// the points of a cell remain in their order.
SortedPoints sort_into_cells(const std::vector<PlanPoint>& points, const HeightField& field) {
  constexpr int shares = 8;
  const int count = static_cast<int>(points.size()), grain = count / shares + 1;
  const int cells = static_cast<int>(field.z.size());
  std::vector<int> cell_of(points.size());
  Image<int> next(cells, shares);  // first the count, then the place of the next point of that cell and share
  parallel_ranges(count, grain, [&](int begin, int end) {
    for (int n = begin; n < end; ++n) {
      const PlanPoint& point = points[static_cast<std::size_t>(n)];
      const int i = static_cast<int>(std::lround(field.i_of(point.p)));
      const int j = static_cast<int>(std::lround(field.j_of(point.q)));
      const int cell = field.z.contains(i, j) ? static_cast<int>(field.index(i, j)) : -1;
      cell_of[static_cast<std::size_t>(n)] = cell;
      if (cell >= 0) ++next(cell, begin / grain);
    }
  });
  SortedPoints sorted;
  sorted.first.assign(static_cast<std::size_t>(cells) + 1, 0);
  int total = 0;
  for (int cell = 0; cell < cells; ++cell) {
    for (int share = 0; share < shares; ++share) total += std::exchange(next(cell, share), total);
    sorted.first[static_cast<std::size_t>(cell) + 1] = static_cast<std::size_t>(total);
  }
  sorted.points.resize(static_cast<std::size_t>(total));
  parallel_ranges(count, grain, [&](int begin, int end) {
    for (int n = begin; n < end; ++n)
      if (const int cell = cell_of[static_cast<std::size_t>(n)]; cell >= 0)
        sorted.points[static_cast<std::size_t>(next(cell, begin / grain)++)] = points[static_cast<std::size_t>(n)];
  });
  return sorted;
}

/// Of each cell the point of median height: robust, and good enough to begin with.
Image<CellMean> median_points(const HeightField& field) {
  Image<CellMean> cells(field.columns(), field.rows());
  parallel_rows(field.rows(), [&](int j) {
    std::vector<PlanPoint> points;
    for (int i = 0; i < field.columns(); ++i) {
      const auto members = field.sorted.of(field.index(i, j));
      if (members.empty()) continue;
      points.assign(members.begin(), members.end());
      const auto middle = points.begin() + static_cast<std::ptrdiff_t>(points.size() / 2);
      std::nth_element(points.begin(), middle, points.end(),
                       [](const PlanPoint& a, const PlanPoint& b) { return a.z < b.z; });
      CellMean& cell = cells(i, j);
      cell.p = static_cast<float>(middle->p - field.p_of(i));
      cell.q = static_cast<float>(middle->q - field.q_of(j));
      cell.z = middle->z;
      cell.weight = 1 / (middle->sigma * middle->sigma);
      cell.count = 1;
    }
  });
  return cells;
}

/// Robust fits to the median points, every few cells, and the noise they show.
Image<LocalFit> first_fits(const Image<CellMean>& medians, HeightField& field, double radius_mm) {
  LocalFitOptions options{radius_mm, 4, std::numeric_limits<double>::infinity()};
  const Image<LocalFit> coarse = fit_lattice(medians, field.cell_mm, 2 * first_pass_step, options);
  std::vector<double> scatters;
  for (const LocalFit& fit : coarse.pixels())
    if (fit.ok) scatters.push_back(fit.scatter);
  if (!scatters.empty()) {
    std::ranges::nth_element(scatters, scatters.begin() + static_cast<std::ptrdiff_t>(scatters.size() / 2));
    field.noise_factor = std::max(0.1, scatters[scatters.size() / 2]);
  }
  options.too_much = edge_scatter * std::max(1.0, field.noise_factor);
  return refine_lattice(coarse, medians, field.cell_mm, first_pass_step, options);
}

/// Whether a point agrees with one of the first fits around it. At an edge of the surface those on its own side do.
bool is_inlier(const PlanPoint& point, const Image<LocalFit>& fits, const HeightField& field) {
  const double own = field.noise_factor * point.sigma;
  const int i0 = static_cast<int>(field.i_of(point.p)) / first_pass_step;
  const int j0 = static_cast<int>(field.j_of(point.q)) / first_pass_step;
  for (const auto& [i, j] : {std::pair(i0, j0), {i0 + 1, j0}, {i0, j0 + 1}, {i0 + 1, j0 + 1}}) {
    if (!fits.contains(i, j) || !fits(i, j).ok) continue;
    const double u = point.p - field.p_of(i * first_pass_step), v = point.q - field.q_of(j * first_pass_step);
    const double residual = point.z - fits(i, j).at(u, v);
    const double scatter_mm = fits(i, j).scatter_mm;
    if (residual * residual < outlier_sigmas * outlier_sigmas * (own * own + scatter_mm * scatter_mm)) return true;
  }
  return false;
}

/// Puts each cell's points that agree with the first fits before those that do not, and averages them.
void keep_inliers(const Image<LocalFit>& fits, HeightField& field) {
  std::vector<std::int64_t> kept(static_cast<std::size_t>(field.rows()), 0);
  parallel_rows(field.rows(), [&](int j) {
    for (int i = 0; i < field.columns(); ++i) {
      const std::span<PlanPoint> members = field.sorted.of(field.index(i, j));
      const auto outliers =
          std::ranges::stable_partition(members, [&](const PlanPoint& point) { return is_inlier(point, fits, field); });
      const auto inliers = members.first(members.size() - outliers.size());
      // Twice as many outliers as inliers: what is left may be chance.
      if (3 * inliers.size() < members.size()) {
        field.status(i, j) = PixelStatus::off_surface;
        continue;
      }
      field.cells(i, j) = mean_of(inliers, field.p_of(i), field.q_of(j));
      kept[static_cast<std::size_t>(j)] += static_cast<std::int64_t>(inliers.size());
    }
  });
  field.outliers = field.points;
  for (const std::int64_t row : kept) field.outliers -= row;
}

void fit_all_cells(HeightField& field, double radius_mm) {
  const double too_much = edge_scatter * std::max(1.0, field.noise_factor);
  const Image<LocalFit> fits = fit_cells(field.cells, field.cell_mm, {radius_mm, 2, too_much, true},
                                         Image<std::uint8_t>(field.columns(), field.rows(), 1));
  parallel_rows(field.rows(), [&](int j) {
    for (int i = 0; i < field.columns(); ++i) {
      const LocalFit& fit = fits(i, j);
      if (field.cells(i, j).count > 0) field.intensity(i, j) = field.cells(i, j).intensity;
      if (!fit.ok) continue;
      field.z(i, j) = static_cast<float>(fit.z);
      field.slope_p(i, j) = static_cast<float>(fit.slopes[0]);
      field.slope_q(i, j) = static_cast<float>(fit.slopes[1]);
      field.sigma(i, j) = static_cast<float>(fit.sigma * std::max(field.noise_factor, fit.scatter));
      field.status(i, j) = PixelStatus::ok;
    }
  });
}

/// Why the cells without a height lack it: pixels without a point are put where the pixels left and right of them in
/// their row measured the surface, and the cell takes the most frequent reason.
void tell_reasons(std::span<const PointMap> cameras, HeightField& field) {
  constexpr std::size_t reasons = names_of(PixelStatus{}).size();
  constexpr int widest_gap_px = 256;
  struct Vote {
    std::size_t cell;
    PixelStatus reason;
  };
  const Eigen::Matrix3d plan_from_rig =
      Eigen::AngleAxisd(-field.frame.angle_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  Image<std::array<std::uint16_t, reasons>> counts(field.columns(), field.rows());
  for (const PointMap& map : cameras) {
    std::vector<std::vector<Vote>> of_rows(static_cast<std::size_t>(map.height()));
    parallel_rows(map.height(), [&](int y) {
      std::vector<Vote>& votes = of_rows[static_cast<std::size_t>(y)];
      const auto vote = [&](const Eigen::Vector3d& rig, PixelStatus reason) {
        const Eigen::Vector3d plan = plan_from_rig * rig;
        const int i = static_cast<int>(std::lround(field.i_of(plan.x())));
        const int j = static_cast<int>(std::lround(field.j_of(plan.y())));
        if (counts.contains(i, j)) votes.push_back({field.index(i, j), reason});
      };
      for (int x = 0, left = -1; x < map.width(); ++x) {
        if (map.status(x, y) != PixelStatus::ok) continue;
        const auto at = [&](int column) {
          return Eigen::Vector3d(map.x(column, y), map.y(column, y), map.z(column, y));
        };
        if (left >= 0 && x - left > 1 && x - left <= widest_gap_px)
          for (int between = left + 1; between < x; ++between) {
            const double share = static_cast<double>(between - left) / (x - left);
            vote((1 - share) * at(left) + share * at(x), map.status(between, y));
          }
        left = x;
      }
    });
    for (const auto& votes : of_rows)
      for (const Vote& vote : votes) ++counts.data()[vote.cell][static_cast<std::size_t>(vote.reason)];
  }
  for (std::size_t k = 0; k < counts.size(); ++k) {
    if (field.status.data()[k] != PixelStatus::not_computed) continue;
    const auto& of_cell = counts.data()[k];
    const auto most = std::ranges::max_element(of_cell);
    if (*most > 0) field.status.data()[k] = static_cast<PixelStatus>(most - of_cell.begin());
  }
}

}  // namespace

HeightField smooth_points(std::span<const PointMap> cameras, const SmoothingOptions& options, Progress& progress) {
  const std::vector<PlanPoint> points = gather_points(cameras, {options.reading_direction_rad});
  if (points.size() < fewest_points)
    throw no_result(
        fmt::format("only {} surface points were measured, at least {} are needed: look at the status maps "
                    "of the cameras for the reason",
                    points.size(), fewest_points));
  HeightField field = empty_field(points, options);
  field.sorted = sort_into_cells(points, field);
  const double radius_mm = std::max(options.radius_mm, 2.5 * field.cell_mm);
  const Image<LocalFit> fits = first_fits(median_points(field), field, radius_mm);
  progress.advance(0.2);
  keep_inliers(fits, field);
  fit_all_cells(field, radius_mm);
  tell_reasons(cameras, field);
  progress.advance(0.4);
  return field;
}

}  // namespace pagesweep
