// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/drift/align_patch.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "pagesweep/data/time_map.h"

namespace pagesweep {
namespace {

constexpr double least_correlation = 0.6;
constexpr double least_known = 0.6;  // share of the patch's pixels

/// Sums for the correlation of two variables.
struct Moments {
  double n = 0, a = 0, b = 0, aa = 0, ab = 0, bb = 0;
  void add(double x, double y) { n += 1, a += x, b += y, aa += x * x, ab += x * y, bb += y * y; }
  double correlation() const {
    const double of_a = aa - a * a / n, of_b = bb - b * b / n;
    return of_a > 0 && of_b > 0 ? (ab - a * b / n) / std::sqrt(of_a * of_b) : 0;
  }
};

/// \param stride  every so-many-th pixel takes part
double correlation_at(const Image<float>& other, const Patch& patch, const Eigen::Vector2d& shift_px,
                      std::size_t stride) {
  Moments moments;
  std::size_t asked = 0;
  for (std::size_t i = 0; i < patch.gray.size(); i += stride, ++asked) {
    const float seen = sample(other, patch.place[i] + shift_px);
    if (std::isfinite(seen)) moments.add(patch.gray[i], seen);
  }
  return moments.n >= least_known * static_cast<double>(asked) ? moments.correlation() : 0;
}

/// Correlations on the grid of shifts.
class Grid {
 public:
  explicit Grid(const ShiftRange& range)
      : step_(range.step),
        reach_(static_cast<int>(std::ceil(range.farthest / range.step))),
        correlation_(2 * reach_ + 1, range.directions.cols() == 2 ? 2 * reach_ + 1 : 1) {}

  void fill(const Image<float>& other, const Patch& patch, const ShiftRange& range) {
    constexpr std::size_t stride = 7;  // prime to the patch's width, so that all columns take part
    for (int j = 0; j < correlation_.height(); ++j)
      for (int i = 0; i < correlation_.width(); ++i)
        correlation_(i, j) =
            static_cast<float>(correlation_at(other, patch, range.directions * shift_at(i, j), stride));
  }

  /// The highest place; nothing if it is at the border, or another one away from it is nearly as high.
  std::optional<Eigen::VectorXd> peak() const {
    constexpr int foot = 3;  // [steps] what belongs to the same peak
    constexpr float least_distinction = 0.15F;
    const auto pixels = correlation_.pixels();
    const auto at = static_cast<int>(std::ranges::max_element(pixels) - pixels.begin());
    const int x = at % correlation_.width(), y = at / correlation_.width();
    const auto at_border = [](int place, int size) { return size > 1 && (place == 0 || place + 1 == size); };
    if (at_border(x, correlation_.width()) || at_border(y, correlation_.height())) return std::nullopt;
    for (int j = 0; j < correlation_.height(); ++j)
      for (int i = 0; i < correlation_.width(); ++i)
        if (std::max(std::abs(i - x), std::abs(j - y)) > foot &&
            correlation_(i, j) > correlation_(x, y) - least_distinction)
          return std::nullopt;
    return shift_at(x, y);
  }

 private:
  Eigen::VectorXd shift_at(int i, int j) const {
    if (correlation_.height() == 1) return Eigen::VectorXd::Constant(1, (i - reach_) * step_);
    return Eigen::Vector2d((i - reach_) * step_, (j - reach_) * step_);
  }

  double step_;
  int reach_;
  Image<float> correlation_;
};

/// Least squares steps for other(place + shift) = gain gray + brightness + slopes . offset.
class Refinement {
 public:
  Refinement(const Image<float>& other, const Patch& patch, const ShiftRange& range)
      : other_(other), patch_(patch), range_(range) {}

  /// \return the change of the shift; nothing if it cannot be told
  std::optional<Eigen::VectorXd> step(const Eigen::VectorXd& shift) {
    const auto shifts = range_.directions.cols(), unknowns = 4 + shifts;
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(unknowns, unknowns);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(unknowns), row(unknowns);
    double squares = 0, samples = 0;
    for (std::size_t i = 0; i < patch_.gray.size(); ++i) {
      const Eigen::Vector2d place = patch_.place[i] + range_.directions * shift;
      const float seen = sample(other_, place);
      const Eigen::Vector2d slope(sample(other_, place + half_px_x) - sample(other_, place - half_px_x),
                                  sample(other_, place + half_px_y) - sample(other_, place - half_px_y));
      if (!std::isfinite(seen) || !slope.allFinite()) continue;
      row << patch_.gray[i], 1, patch_.offset[i], -(range_.directions.transpose() * slope);
      normal.selfadjointView<Eigen::Lower>().rankUpdate(row);
      right += seen * row;
      squares += static_cast<double>(seen) * seen;
      samples += 1;
    }
    if (samples < least_known * static_cast<double>(patch_.gray.size())) return std::nullopt;
    const Eigen::LDLT<Eigen::MatrixXd> solver(normal.selfadjointView<Eigen::Lower>());
    const Eigen::VectorXd solution = solver.solve(right);
    if (solver.info() != Eigen::Success || !solution.allFinite() || !(solution(0) > 0)) return std::nullopt;
    const double variance = std::max(0.0, squares - solution.dot(right)) / samples;
    const Eigen::MatrixXd inverse = solver.solve(Eigen::MatrixXd::Identity(unknowns, unknowns));
    // Four pixels share in each bilinear sample: a patch has a quarter of its pixels' independent differences.
    covariance_ = 4 * variance * inverse.bottomRightCorner(shifts, shifts);
    return solution.tail(shifts);
  }

  const Eigen::MatrixXd& covariance() const { return covariance_; }

 private:
  inline static const Eigen::Vector2d half_px_x{0.5, 0}, half_px_y{0, 0.5};
  const Image<float>& other_;
  const Patch& patch_;
  const ShiftRange& range_;
  Eigen::MatrixXd covariance_;
};

}  // namespace

float sample(const Image<float>& image, const Eigen::Vector2d& position) {
  const double u = position.x(), v = position.y();
  if (!(u >= 0 && v >= 0 && u <= image.width() - 1 && v <= image.height() - 1)) return not_a_number;
  const int x = std::min(static_cast<int>(u), image.width() - 2), y = std::min(static_cast<int>(v), image.height() - 2);
  if (x < 0 || y < 0) return not_a_number;
  const auto a = static_cast<float>(u - x), b = static_cast<float>(v - y);
  const float top = image(x, y) + a * (image(x + 1, y) - image(x, y));
  const float bottom = image(x, y + 1) + a * (image(x + 1, y + 1) - image(x, y + 1));
  return top + b * (bottom - top);
}

std::optional<Shift> align_patch(const Image<float>& other, const Patch& patch, const ShiftRange& range) {
  constexpr int most_steps = 15;
  constexpr double arrived = 1e-3;
  Grid grid(range);
  grid.fill(other, patch, range);
  const auto start = grid.peak();
  if (!start) return std::nullopt;
  Refinement refinement(other, patch, range);
  Eigen::VectorXd shift = *start;
  for (int i = 0; i < most_steps; ++i) {
    const auto change = refinement.step(shift);
    if (!change) return std::nullopt;
    shift += *change;
    if ((shift - *start).cwiseAbs().maxCoeff() > 2 * range.step) return std::nullopt;  // it was no peak
    if (change->cwiseAbs().maxCoeff() > arrived) continue;
    const double correlation = correlation_at(other, patch, range.directions * shift, 1);
    if (correlation < least_correlation) return std::nullopt;
    return Shift{shift, refinement.covariance(), correlation};
  }
  return std::nullopt;
}

}  // namespace pagesweep
