// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <vector>

#include "pagesweep/dewarping/edge_line_internal.h"

namespace pagesweep {
namespace {

/// Weighted least squares line; nothing if the points do not define one.
std::optional<EdgeLine> fit_line(std::span<const EdgePoint> points, std::span<const double> weights) {
  double w = 0, a = 0, c = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    w += weights[i];
    a += weights[i] * points[i].along_mm;
    c += weights[i] * points[i].across_mm;
  }
  if (!(w > 0)) return std::nullopt;
  EdgeLine line{.along_mm = a / w, .across_mm = c / w};
  double aa = 0, ac = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double along = points[i].along_mm - line.along_mm;
    aa += weights[i] * along * along;
    ac += weights[i] * along * (points[i].across_mm - line.across_mm);
  }
  if (!(aa > 0)) return std::nullopt;
  line.slope = ac / aa;
  double squares = 0;
  for (std::size_t i = 0; i < points.size(); ++i)
    squares += weights[i] * std::pow(points[i].across_mm - line.across_at(points[i].along_mm), 2);
  // Paper edges are wavy: neighbouring points err alike, so that ten of them count as one.
  constexpr double correlated = 10;
  line.slope_sigma = std::sqrt(correlated * squares / w / aa);
  return line;
}

/// Lines across = offset + slope along, in bins: how many points lie in each.
class Votes {
 public:
  Votes(std::span<const EdgePoint> points, double tolerance_mm, double max_slope) : tolerance_mm_(tolerance_mm) {
    const auto [first, last] =
        std::minmax_element(points.begin(), points.end(), [](auto& a, auto& b) { return a.along_mm < b.along_mm; });
    middle_mm_ = 0.5 * (first->along_mm + last->along_mm);
    // Neighbouring slopes differ by less than the tolerance at the ends of the edge.
    slope_step_ = tolerance_mm / std::max(tolerance_mm, 0.5 * (last->along_mm - first->along_mm));
    slopes_ = static_cast<int>(max_slope / slope_step_);
  }

  /// The line with most of the points that are not yet `taken`.
  EdgeLine best(std::span<const EdgePoint> points, const std::vector<char>& taken) const {
    EdgeLine best{.along_mm = middle_mm_};
    int most = 0;
    for (int k = -slopes_; k <= slopes_; ++k) {
      std::vector<int> bins;
      for (std::size_t i = 0; i < points.size(); ++i) {
        if (taken[i]) continue;
        const double offset = points[i].across_mm - k * slope_step_ * (points[i].along_mm - middle_mm_);
        const auto bin = static_cast<std::ptrdiff_t>(std::floor(offset / tolerance_mm_)) + bin_of_zero;
        if (bin < 0 || bin > 4 * bin_of_zero) continue;
        if (bins.size() <= static_cast<std::size_t>(bin) + 1) bins.resize(static_cast<std::size_t>(bin) + 2);
        ++bins[static_cast<std::size_t>(bin)];
      }
      for (std::size_t bin = 0; bin + 1 < bins.size(); ++bin)  // two bins together: none falls between
        if (const int votes = bins[bin] + bins[bin + 1]; votes > most) {
          most = votes;
          best.across_mm = (static_cast<double>(bin) + 1 - bin_of_zero) * tolerance_mm_;
          best.slope = k * slope_step_;
        }
    }
    return best;
  }

 private:
  static constexpr int bin_of_zero = 2000;
  double tolerance_mm_;
  double middle_mm_ = 0;
  double slope_step_ = 0;
  int slopes_ = 0;
};

/// Takes the points near a line and fits it to them; nothing if there are too few.
std::optional<EdgeLine> take_points(std::span<const EdgePoint> points, const EdgeLine& line, double tolerance_mm,
                                    std::vector<char>& taken) {
  std::vector<double> weights(points.size(), 0.0);
  double count = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (taken[i] || std::abs(points[i].across_mm - line.across_at(points[i].along_mm)) > 1.5 * tolerance_mm) continue;
    taken[i] = true;
    weights[i] = 1;
    ++count;
  }
  auto fitted = fit_line(points, weights);
  if (fitted) fitted->share = count / static_cast<double>(points.size());
  return fitted;
}

}  // namespace

std::optional<EdgeLine> find_edge_line(std::span<const EdgePoint> points, double pitch_mm, double tolerance_mm,
                                       double min_length_mm, double max_slope) {
  constexpr double fair_share = 0.3;
  if (points.size() < 8) return std::nullopt;
  const Votes votes(points, tolerance_mm, max_slope);
  std::vector<char> taken(points.size(), false);
  const double least = min_length_mm / pitch_mm / static_cast<double>(points.size());
  std::optional<EdgeLine> outermost;
  double best_share = 0;
  for (int i = 0; i < 4; ++i) {
    const auto line = take_points(points, votes.best(points, taken), tolerance_mm, taken);
    if (!line || line->share < std::max(least, fair_share * best_share)) break;
    best_share = std::max(best_share, line->share);
    if (!outermost || line->across_mm < outermost->across_at(line->along_mm) - tolerance_mm) outermost = line;
  }
  return outermost;
}

std::optional<EdgeLine> refine_edge_line(std::span<const EdgePoint> points, const EdgeLine& start) {
  if (points.empty()) return std::nullopt;
  EdgeLine line = start;
  std::vector<double> residuals(points.size()), weights(points.size());
  for (int round = 0; round < 20; ++round) {
    for (std::size_t i = 0; i < points.size(); ++i)
      residuals[i] = std::abs(points[i].across_mm - line.across_at(points[i].along_mm));
    std::vector<double> sorted = residuals;
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    const double reach = 4.685 * std::max(1.4826 * *middle, 0.02);  // Tukey: 95 % efficient on Gaussian scatter
    std::size_t inside = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double x = residuals[i] / reach;
      weights[i] = x < 1 ? (1 - x * x) * (1 - x * x) : 0;
      inside += x < 1;
    }
    const auto fitted = fit_line(points, weights);
    if (!fitted || inside < 8) return std::nullopt;
    const double change = std::abs(fitted->across_at(line.along_mm) - line.across_mm);
    line = *fitted;
    line.share = static_cast<double>(inside) / static_cast<double>(points.size());
    if (change < 1e-6) break;
  }
  return line;
}

}  // namespace pagesweep
