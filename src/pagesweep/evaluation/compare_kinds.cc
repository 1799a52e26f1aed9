// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/compare_kinds.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

constexpr float gutter_reach_mm = 15;
constexpr int rim_px = 2;

struct Tally {
  std::vector<double> distances, claims, bounds;

  void add(double distance, double claim, double bound) {
    distances.push_back(distance);
    claims.push_back(claim);
    if (std::isfinite(bound)) bounds.push_back(bound);
  }
  void add(const Tally& other) {
    distances.insert(distances.end(), other.distances.begin(), other.distances.end());
    claims.insert(claims.end(), other.claims.begin(), other.claims.end());
    bounds.insert(bounds.end(), other.bounds.begin(), other.bounds.end());
  }
  PointsOfKind summary() const { return {summarise(distances), rms_of(claims), rms_of(bounds)}; }
};

struct Tallies {
  Tally blank, print, bright_print, near_gutter, elsewhere;
};

bool is_at_rim(const TruePoints& truth, int x, int y) {
  for (int j = -rim_px; j <= rim_px; ++j)
    for (int i = -rim_px; i <= rim_px; ++i)
      if (!truth.contains(x + i, y + j) || !truth(x + i, y + j).allFinite()) return true;
  return false;
}

bool is_near(std::span<const Eigen::Vector3f> gutter, const Eigen::Vector3f& point) {
  return std::ranges::any_of(gutter, [&](const Eigen::Vector3f& place) {
    return (place - point).head<2>().squaredNorm() < gutter_reach_mm * gutter_reach_mm;
  });
}

/// 1 within two pixels of an edge of print or of something dark.
Image<std::uint8_t> printed_areas(const TimeMap& times, const TimeComparisonOptions& options) {
  constexpr int reach = 2;
  Image<std::uint8_t> printed(times.width(), times.height());
  for (int y = 0; y < times.height(); ++y)
    for (int x = 0; x < times.width(); ++x) {
      const bool dark = times.amplitude(x, y) <= options.bright_amplitude;
      if (!dark && !(relative_gradient(times.amplitude, x, y) > options.print_edge)) continue;
      for (int j = std::max(0, y - reach); j <= std::min(y + reach, times.height() - 1); ++j)
        for (int i = std::max(0, x - reach); i <= std::min(x + reach, times.width() - 1); ++i) printed(i, j) = 1;
    }
  return printed;
}

void add_pixel(const KindView& view, const Image<std::uint8_t>& printed, int x, int y,
               std::span<const Eigen::Vector3f> gutter, const TimeComparisonOptions& options,
               const BoundOfAmplitude& bound, Tallies& tallies) {
  const double distance = (*view.distances)(x, y);
  const Eigen::Vector3d center = view.camera->center();
  const Eigen::Vector3f& truth = (*view.truth)(x, y);
  const double incidence =
      true_normal(*view.truth, x, y, center).dot((center - truth.cast<double>()).normalized());  // cosine
  const double claim = view.points->sigma(x, y) * incidence;
  if (!std::isfinite(distance) || !std::isfinite(claim)) return;
  const double amplitude = view.times->amplitude(x, y);
  // A point's standard deviation is in proportion to that of its time value.
  const double bounded =
      bound ? claim * bound(amplitude) / view.times->sigma(x, y) : std::numeric_limits<double>::quiet_NaN();
  if (!gutter.empty()) (is_near(gutter, truth) ? tallies.near_gutter : tallies.elsewhere).add(distance, claim, bounded);
  if (is_at_rim(*view.truth, x, y)) return;
  (printed(x, y) ? tallies.print : tallies.blank).add(distance, claim, bounded);
  if (printed(x, y) && amplitude > options.bright_amplitude) tallies.bright_print.add(distance, claim, bounded);
}

}  // namespace

double relative_gradient(const Image<float>& amplitude, int x, int y) {
  if (!amplitude.contains(x - 1, y - 1) || !amplitude.contains(x + 1, y + 1)) return ErrorSummary::none;
  const double dx = 0.5 * (amplitude(x + 1, y) - amplitude(x - 1, y));
  const double dy = 0.5 * (amplitude(x, y + 1) - amplitude(x, y - 1));
  return std::hypot(dx, dy) / amplitude(x, y);
}

KindComparison compare_kinds(std::span<const KindView> views, std::span<const Eigen::Vector3f> gutter,
                             const TimeComparisonOptions& options, const BoundOfAmplitude& bound) {
  Tallies all;
  for (const KindView& view : views) {
    const Image<std::uint8_t> printed = printed_areas(*view.times, options);
    std::vector<Tallies> rows(static_cast<std::size_t>(view.points->height()));
    parallel_rows(view.points->height(), [&](int y) {
      for (int x = 0; x < view.points->width(); ++x)
        add_pixel(view, printed, x, y, gutter, options, bound, rows[static_cast<std::size_t>(y)]);
    });
    for (const Tallies& row : rows)
      for (const auto part :
           {&Tallies::blank, &Tallies::print, &Tallies::bright_print, &Tallies::near_gutter, &Tallies::elsewhere})
        (all.*part).add(row.*part);
  }
  return {all.blank.summary(), all.print.summary(), all.bright_print.summary(), all.near_gutter.summary(),
          all.elsewhere.summary()};
}

}  // namespace pagesweep
