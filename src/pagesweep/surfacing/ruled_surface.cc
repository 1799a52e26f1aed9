// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/ruled_surface.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "pagesweep/base/error.h"

namespace pagesweep {
namespace {

constexpr double finest_knots_mm = 1.5, coarsest_knots_mm = 8, knots_growth = 0.12;
constexpr double cauchy_cutoff = 2.385;       // 95 % efficiency under Gaussian noise
constexpr double smallest_scatter_mm = 0.02;  // the model itself is never truer than this
constexpr double cells_per_unknown = 4;
constexpr double caution = 1.4;                   // of cross-validation
constexpr double difference_stiffness = 1.0 / 3;  // 1/12 would weigh both profiles alike

/// One cell's row of the design matrix.
struct Row {
  BSplineRow splines;  // value: averaged over the cell
  double tau, z, weight, cosine;
  double robust;
};

struct Fit {
  RuledSurface surface;
  std::vector<Row> rows;
};

double median_of(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Knots densest at the gutter (alpha = 0), where pages bend most, and few enough for the data.
std::vector<double> choose_breaks(double from, double to, bool gutter, std::size_t cells) {
  const double most = std::max(1.0, static_cast<double>(cells) / (2 * cells_per_unknown) - 3);
  for (double stretch = 1;; stretch *= 1.3) {
    std::vector<double> breaks{0};
    const double length = to - from;
    for (double x = 0; x < length;) {
      const double grown = gutter ? finest_knots_mm + knots_growth * x : 0.75 * coarsest_knots_mm;
      x += stretch * std::min(coarsest_knots_mm, grown);
      breaks.push_back(x);
    }
    const double shrink = length / breaks.back();
    for (double& x : breaks) x *= shrink;
    if (static_cast<double>(breaks.size()) - 1 > most && breaks.size() > 2) continue;
    const bool ends_at_gutter = gutter && std::abs(to) < std::abs(from);
    for (double& x : breaks) x = ends_at_gutter ? to - x : from + x;
    if (ends_at_gutter) std::ranges::reverse(breaks);
    return breaks;
  }
}

double value_of(const Row& row, const Eigen::VectorXd& c) {
  double sum = 0;
  for (std::size_t k = 0; k < 4; ++k) sum += row.splines.value[k] * c(row.splines.first + static_cast<int>(k));
  return sum;
}

double residual_of(const Row& row, const RuledSurface& s) {
  return ((1 - row.tau) * value_of(row, s.low) + row.tau * value_of(row, s.high) - row.z) * row.cosine;
}

/// Normal equations of all rows; unknowns are the coefficients of the lower, then of the upper profile.
struct NormalEquations {
  Eigen::MatrixXd a;
  Eigen::VectorXd b;
  double z_squared = 0;
};

NormalEquations add_up(const std::vector<Row>& rows, int n) {
  // A row concerns four neighbouring splines of either profile: a small block, which is added up in place.
  struct Block {
    Eigen::Matrix<double, 8, 8> a = Eigen::Matrix<double, 8, 8>::Zero();
    Eigen::Matrix<double, 8, 1> b = Eigen::Matrix<double, 8, 1>::Zero();
  };
  std::vector<Block> blocks(static_cast<std::size_t>(n - 3));
  NormalEquations sums{Eigen::MatrixXd::Zero(2 * n, 2 * n), Eigen::VectorXd::Zero(2 * n), 0};
  for (const Row& row : rows) {
    const double w = row.weight * row.robust * row.cosine * row.cosine;
    const Eigen::Map<const Eigen::Vector4d> splines(row.splines.value.data());
    Eigen::Matrix<double, 8, 1> x;
    x << (1 - row.tau) * splines, row.tau * splines;
    const Eigen::Matrix<double, 8, 1> weighted = w * x;
    Block& block = blocks[static_cast<std::size_t>(row.splines.first)];
    block.a.noalias() += weighted * x.transpose();
    block.b += row.z * weighted;
    sums.z_squared += w * row.z * row.z;
  }
  for (int first = 0; first + 3 < n; ++first) {
    const Block& block = blocks[static_cast<std::size_t>(first)];
    for (const int half : {0, 1}) {
      sums.b.segment<4>(half * n + first) += block.b.segment<4>(4 * half);
      for (const int other : {0, 1})
        sums.a.block<4, 4>(half * n + first, other * n + first) += block.a.block<4, 4>(4 * half, 4 * other);
    }
  }
  return sums;
}

/// Penalty on the curvature of the mean profile and of the profiles' difference. Bending z'' counts by the curvature of
/// the steep profile that it means, z'' / (1 + z'^2)^(3/2), squared and per arc length.
Eigen::MatrixXd stiffness_of(const RuledSurface& s) {
  const auto& breaks = s.splines.breaks();
  std::vector<double> weights;
  for (std::size_t k = 0; k + 1 < breaks.size(); ++k) {
    const double slope = s.at(0.5 * (breaks[k] + breaks[k + 1]), 0.5 * (s.b_low + s.b_high)).slope;
    weights.push_back(std::pow(1 + slope * slope, -2.5));
  }
  const Eigen::MatrixXd bending = s.splines.bending(weights);
  const auto n = bending.rows();
  Eigen::MatrixXd stiffness(2 * n, 2 * n);
  stiffness.topLeftCorner(n, n) = stiffness.bottomRightCorner(n, n) = (0.25 + difference_stiffness) * bending;
  stiffness.topRightCorner(n, n) = stiffness.bottomLeftCorner(n, n) = (0.25 - difference_stiffness) * bending;
  return stiffness;
}

/// Keeps the twist of the surface determined where all the data is on one ruling.
void add_ridge(Eigen::MatrixXd& a) {
  const auto n = a.rows() / 2;
  const double ridge = 1e-7 * a.trace() / static_cast<double>(2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    a(i, i) += 1.001 * ridge;
    a(n + i, n + i) += 1.001 * ridge;
    a(i, n + i) -= ridge;
    a(n + i, i) -= ridge;
  }
}

void solve(const NormalEquations& sums, const Eigen::MatrixXd& stiffness, double relative, RuledSurface& s) {
  const double lambda = relative * sums.a.trace() / std::max(1e-300, stiffness.trace());
  Eigen::MatrixXd a = sums.a + lambda * stiffness;
  add_ridge(a);
  const Eigen::VectorXd c = a.ldlt().solve(sums.b);
  s.low = c.head(c.size() / 2);
  s.high = c.tail(c.size() / 2);
}

/// Stiffness (relative to the data's) with the smallest generalised cross-validation score RSS / (n - 1.4 trace)^2; the
/// factor keeps it from following noise where there are few places (Kim and Gu 2004).
double cross_validate(const NormalEquations& sums, const Eigen::MatrixXd& stiffness, std::size_t rows) {
  double best = 1e-6, best_score = std::numeric_limits<double>::infinity();
  for (double relative = 1e-10; relative < 2e4; relative *= 10) {
    const double lambda = relative * sums.a.trace() / std::max(1e-300, stiffness.trace());
    Eigen::MatrixXd a = sums.a + lambda * stiffness;
    add_ridge(a);
    const Eigen::LDLT<Eigen::MatrixXd> factor(a);
    const Eigen::VectorXd c = factor.solve(sums.b);
    const double rss = std::max(0.0, sums.z_squared - 2 * c.dot(sums.b) + c.dot(sums.a * c));
    const double freedom = static_cast<double>(rows) - caution * factor.solve(sums.a).trace();
    const double score = rss / (freedom * freedom);
    if (freedom > 0 && score < best_score) {
      best_score = score;
      best = relative;
    }
  }
  return best;
}

/// Cauchy's weights; \return mean of log(1 + (r / cut-off)^2), which they minimise.
double reweight(Fit& fit, double scatter_mm) {
  double cost = 0;
  const double unit = 1 / (cauchy_cutoff * scatter_mm);
  for (Row& row : fit.rows) {
    const double x = residual_of(row, fit.surface) * unit;
    row.robust = 1 / (1 + x * x);
    cost += std::log1p(x * x);
  }
  return cost / static_cast<double>(fit.rows.size());
}

double scatter_of(const Fit& fit) {
  std::vector<double> sizes;
  sizes.reserve(fit.rows.size());
  for (const Row& row : fit.rows) sizes.push_back(std::abs(residual_of(row, fit.surface)));
  return std::max(smallest_scatter_mm, 1.4826 * median_of(std::move(sizes)));
}

/// Weights by the slope: a vertical residual on a steep place is a small distance.
void update_cosines(Fit& fit, std::span<const Support> cells) {
  for (std::size_t k = 0; k < fit.rows.size(); ++k) {
    const Eigen::Vector2d at = fit.surface.frame.ruling_from_plan(cells[k].plan);
    const double slope = fit.surface.at(at.x(), at.y()).slope / (1 + fit.surface.frame.fan * at.y());
    fit.rows[k].cosine = 1 / std::sqrt(1 + slope * slope);
  }
}

/// A level surface with splines and rows ready for this frame.
Fit prepare(std::span<const Support> cells, const RulingFrame& frame, bool gutter) {
  Fit fit;
  RuledSurface& s = fit.surface;
  s.frame = frame;
  double from = gutter ? 0 : 1e300, to = gutter ? 0 : -1e300;
  s.b_low = 1e300;
  s.b_high = -1e300;
  std::vector<Eigen::Vector2d> places;
  places.reserve(cells.size());
  const Eigen::Vector2d across = frame.across(), along = frame.along();
  for (const Support& cell : cells) {
    const double b = along.dot(cell.plan - frame.origin);
    places.emplace_back(across.dot(cell.plan - frame.origin) / (1 + frame.fan * b), b);
    from = std::min(from, places.back().x());
    to = std::max(to, places.back().x());
    s.b_low = std::min(s.b_low, places.back().y());
    s.b_high = std::max(s.b_high, places.back().y());
  }
  s.b_high = std::max(s.b_high, s.b_low + 1);
  to = std::max(to, from + 1);
  s.splines = CubicBSplines(choose_breaks(from, to, gutter, cells.size()));
  s.low = s.high = Eigen::VectorXd::Zero(s.splines.size());
  fit.rows.reserve(cells.size());
  for (std::size_t k = 0; k < cells.size(); ++k) {
    const double stretch = 1 + frame.fan * places[k].y();
    const double width = across.dot(cells[k].covariance * across) / (stretch * stretch);
    Row row{s.splines.at(places[k].x()),
            (places[k].y() - s.b_low) / (s.b_high - s.b_low),
            cells[k].z,
            cells[k].weight,
            1,
            1};
    for (std::size_t j = 0; j < 4; ++j) row.splines.value[j] += 0.5 * width * row.splines.curvature[j];
    fit.rows.push_back(row);
  }
  return fit;
}

/// Fit with given rulings and stiffness, a few robust steps. \return the robust cost, see reweight()
double fit_quickly(Fit& fit, double relative_stiffness, double scatter_mm, int steps) {
  const int n = fit.surface.splines.size();
  double cost = 0;
  for (int step = 0; step < steps; ++step) {
    solve(add_up(fit.rows, n), stiffness_of(fit.surface), relative_stiffness, fit.surface);
    cost = reweight(fit, scatter_mm > 0 ? scatter_mm : scatter_of(fit));
  }
  return cost;
}

/// The rulings' direction and fan, by a pattern search over the robust cost. What the data leaves open (a plane has
/// rulings in every direction) a weak preference for straight up and parallel decides.
class RulingSearch {
 public:
  RulingSearch(std::span<const Support> cells, bool gutter, double half_length_mm)
      : gutter_(gutter), half_length_mm_(half_length_mm) {
    const std::size_t stride = std::max<std::size_t>(1, cells.size() / 3000);
    for (std::size_t k = 0; k < cells.size(); k += stride) cells_.push_back(cells[k]);
  }

  RulingFrame search(const RulingFrame& start) {
    Fit first = prepare(cells_, start, gutter_);
    fit_quickly(first, search_stiffness, 0, 4);
    scatter_mm_ = scatter_of(first);
    RulingFrame best = start;
    double best_cost = cost(best, start.angle_rad());
    if (!gutter_)
      for (const double turn : {0.25, 0.5, -0.25}) {
        const RulingFrame turned = start.turned(turn * std::numbers::pi);
        // Rulings across the page must earn it.
        if (const double c = cost(turned, turned.angle_rad()); c < 0.5 * best_cost - 2) {
          best_cost = c;
          best = turned;
        }
      }
    // Once more with the scatter that good rulings leave: it is what makes the cost sharp.
    best = refine(best, best_cost);
    Fit second = prepare(cells_, best, gutter_);
    fit_quickly(second, search_stiffness, 0, 4);
    scatter_mm_ = scatter_of(second);
    return refine(best, cost(best, best.angle_rad()));
  }

 private:
  static constexpr double search_stiffness = 1e-6;
  static constexpr double preference = 0.5;    // turn [rad] and fan that cost as much as one in the log likelihood
  static constexpr double largest_fan = 0.35;  // change of the rulings' distance over half the page

  RulingFrame refine(RulingFrame best, double best_cost) const {
    const double preferred_angle = best.angle_rad();
    for (double step = 0.08; step > 5e-4; step *= 0.5)
      for (bool improved = true; improved;) {
        improved = false;
        for (const double sign : {1.0, -1.0})
          for (const bool turn : {true, false}) {
            if (turn && gutter_) continue;
            const RulingFrame trial = turn ? best.turned(sign * step) : best.fanned(sign * step / half_length_mm_);
            if (std::abs(trial.fan) * half_length_mm_ > largest_fan) continue;
            if (const double c = cost(trial, preferred_angle); c < best_cost - 1e-4) {
              best_cost = c;
              best = trial;
              improved = true;
            }
          }
      }
    return best;
  }

  double cost(const RulingFrame& frame, double preferred_angle) const {
    Fit fit = prepare(cells_, frame, gutter_);
    const double mean = fit_quickly(fit, search_stiffness, scatter_mm_, 2);
    const double turn = (frame.angle_rad() - preferred_angle) / preference,
                 fan = frame.fan * half_length_mm_ / preference;
    // Neighbouring cells err alike: count one in thirty.
    return mean * static_cast<double>(cells_.size()) / 30 + turn * turn + fan * fan;
  }

  std::vector<Support> cells_;
  bool gutter_;
  double half_length_mm_;
  double scatter_mm_ = 1;
};

}  // namespace

Eigen::Vector2d RulingFrame::ruling_from_plan(const Eigen::Vector2d& plan) const {
  const Eigen::Vector2d from_origin = plan - origin;
  const double a = across().dot(from_origin), b = along().dot(from_origin);
  return {a / (1 + fan * b), b};
}

Eigen::Vector2d RulingFrame::plan_from_ruling(double alpha, double b) const {
  return origin + alpha * (1 + fan * b) * across() + b * along();
}

RuledSurface::Height RuledSurface::at(double alpha, double b) const {
  const BSplineRow row = splines.at(alpha);
  const double tau = (b - b_low) / (b_high - b_low);
  Height height{0, 0, 0};
  for (std::size_t k = 0; k < 4; ++k) {
    const auto i = row.first + static_cast<Eigen::Index>(k);
    const double c = (1 - tau) * low(i) + tau * high(i);
    height.z += c * row.value[k];
    height.slope += c * row.slope[k];
    height.curvature += c * row.curvature[k];
  }
  return height;
}

Eigen::Vector3d RuledSurface::point(double alpha, double b) const {
  const Eigen::Vector2d plan = frame.plan_from_ruling(alpha, b);
  return {plan.x(), plan.y(), at(alpha, b).z};
}

double RuledSurface::height(const Eigen::Vector2d& plan) const {
  const Eigen::Vector2d place = frame.ruling_from_plan(plan);
  return at(place.x(), place.y()).z;
}

Eigen::Vector3d RuledSurface::normal(double alpha, double b) const {
  const BSplineRow row = splines.at(alpha);
  const double length = b_high - b_low, tau = (b - b_low) / length;
  double rise_across = 0, rise_along = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    const auto i = row.first + static_cast<Eigen::Index>(k);
    rise_across += ((1 - tau) * low(i) + tau * high(i)) * row.slope[k];
    rise_along += (high(i) - low(i)) / length * row.value[k];
  }
  const Eigen::Vector2d plan_across = (1 + frame.fan * b) * frame.across();
  const Eigen::Vector2d plan_along = frame.fan * alpha * frame.across() + frame.along();
  const Eigen::Vector3d across(plan_across.x(), plan_across.y(), rise_across);
  const Eigen::Vector3d along(plan_along.x(), plan_along.y(), rise_along);
  return across.cross(along).normalized();
}

double height_over(const RuledSurface& surface, const Support& cell) {
  const Eigen::Vector2d place = surface.frame.ruling_from_plan(cell.plan);
  const double stretch = 1 + surface.frame.fan * place.y();
  const Eigen::Vector2d across = surface.frame.across();
  const RuledSurface::Height height = surface.at(place.x(), place.y());
  return height.z + 0.5 * height.curvature * across.dot(cell.covariance * across) / (stretch * stretch);
}

RuledSurface fit_ruled_surface(std::span<const Support> cells, const RuledFitOptions& options) {
  if (cells.size() < 6)
    throw no_result(fmt::format("a page needs measurements in at least 6 places, there are {}", cells.size()));
  RulingFrame frame;
  Eigen::Vector2d low = cells[0].plan, high = cells[0].plan;
  for (const Support& cell : cells) {
    low = low.cwiseMin(cell.plan);
    high = high.cwiseMax(cell.plan);
  }
  frame.origin = 0.5 * (low + high);
  if (options.gutter) frame = *options.gutter;
  if (options.search)
    frame = RulingSearch(cells, options.gutter.has_value(), std::max(1.0, 0.5 * (high - low).y())).search(frame);

  Fit fit = prepare(cells, frame, options.gutter.has_value());
  RuledSurface& surface = fit.surface;
  fit_quickly(fit, 1e-6, 0, 4);
  update_cosines(fit, cells);
  const double relative = options.smoothing * cross_validate(add_up(fit.rows, surface.splines.size()),
                                                             stiffness_of(surface), fit.rows.size());
  fit_quickly(fit, relative, 0, 3);
  surface.scatter_mm = scatter_of(fit);
  return surface;
}

}  // namespace pagesweep
