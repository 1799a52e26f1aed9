// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/time_finder_internal.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <utility>

namespace pagesweep {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double tolerance_px = 1e-4;

/// A spot of paper is about as bright in both cameras. Light that strays into a dark pixel beside bright paper has
/// times as well, but not the paper's amplitude: a match of this contrast is looked at twice, of that one refused.
constexpr double suspicious = 4, impossible = 8;

/// How far the other camera's time, along one curve, is ahead of one pixel's.
struct TimeDifference {
  const TimeField* field;
  const EpipolarCurve* curve;
  double time;

  /// [frames] NaN where the other camera has no time, or does not see.
  double operator()(double w) const {
    if (!curve->contains(w)) return nan;
    const auto pixel = curve->at(w);
    return pixel ? field->time_at(*pixel) - time : nan;
  }
};

/// A place where the difference may vanish: its sign changes from `low` to `high`.
struct Bracket {
  double low, high;
  double at_low, at_high;
};

/// Root within a bracket by regula falsi (Illinois), nothing if it closes around a gap of the time map.
std::optional<double> solve(const TimeDifference& difference, Bracket b, double step) {
  for (int i = 0; i < 40; ++i) {
    const double w = b.low - b.at_low * (b.high - b.low) / (b.at_high - b.at_low);
    const double value = difference(w);
    if (std::isnan(value)) return std::nullopt;
    if (value == 0 || std::abs(b.high - b.low) < tolerance_px * step) return w;
    if ((value > 0) == (b.at_low > 0)) {
      if (std::abs(w - b.low) < tolerance_px * step) return w;
      b.low = w;
      b.at_low = value;
      b.at_high /= 2;
    } else {
      if (std::abs(w - b.high) < tolerance_px * step) return w;
      b.high = w;
      b.at_high = value;
      b.at_low /= 2;
    }
  }
  return std::nullopt;
}

/// Root near the left neighbour's depth: steps downhill from there until the sign changes.
std::optional<double> follow(const TimeDifference& difference, double expected, double step) {
  constexpr double reach_px = 6;
  double w = expected, here = difference(expected), ahead = difference(expected + step);
  if (here == 0) return expected;
  if (!((here > 0) == (ahead > 0))) return solve(difference, {expected, expected + step, here, ahead}, step);
  double slope = ahead - here;  // [frames/px]
  for (int tries = 0; tries < 4; ++tries) {
    const double distance = -here / slope;  // [px] as the neighbourhood predicts
    const double next = w + (distance + std::copysign(0.3, distance)) * step;
    if (!(std::abs(next - expected) < reach_px * step)) return std::nullopt;  // NaN, too
    const double there = difference(next);
    if (std::isnan(there)) return std::nullopt;
    if ((there > 0) != (here > 0)) return solve(difference, {w, next, here, there}, step);
    if (!(std::abs(there) < std::abs(here))) return std::nullopt;  // no way down here
    slope = (there - here) * step / (next - w);
    w = next;
    here = there;
  }
  return std::nullopt;
}

/// Which of several roots belongs to the pixel: the one that continues the left neighbour's surface, if the others are
/// far from it; nothing if that cannot be told.
std::optional<double> choose(const std::vector<double>& roots, double expected, double step) {
  if (roots.size() == 1) return roots[0];
  double nearest = nan, nearest_px = std::numeric_limits<double>::infinity(), second_px = nearest_px;
  for (const double root : roots) {
    const double distance_px = std::abs(root - expected) / step;
    if (distance_px < nearest_px) {
      second_px = std::exchange(nearest_px, distance_px);
      nearest = root;
    } else if (distance_px < second_px) {
      second_px = distance_px;
    }
  }
  const bool clear = nearest_px < 4 && second_px > 3 * nearest_px + 4;
  return clear ? std::optional(nearest) : std::nullopt;
}

}  // namespace

struct TimeFinder::Wanted {
  TimeDifference difference;
  float sigma, amplitude;
};

CurveBatch make_batch(const SearchedMap& to, const EpipolarGeometry& geometry) {
  CurveBatch batch{};
  batch.times = to.field->arrays();
  batch.lens = geometry.view().lens();
  for (int i = 0; i < 9; ++i)
    batch.rotation[static_cast<std::size_t>(i)] = static_cast<float>(geometry.rotation()(i / 3, i % 3));
  for (int i = 0; i < 3; ++i) batch.origin[static_cast<std::size_t>(i)] = static_cast<float>(geometry.origin()[i]);
  batch.far = static_cast<float>(geometry.range().far);
  batch.near = static_cast<float>(geometry.range().near);
  batch.brightness = static_cast<float>(to.brightness);
  batch.most_contrast = static_cast<float>(suspicious);
  return batch;
}

Match TimeFinder::find(int x, int y, const EpipolarCurve& curve, double expected) {
  const Wanted wanted{{to_.field, &curve, from_.time(x, y)}, from_.sigma(x, y), from_.amplitude(x, y)};
  if (curve.contains(expected))
    if (const auto root = follow(wanted.difference, expected, 1 / curve.speed(expected)))
      if (contrast(*root, wanted) < suspicious) return match_at(*root, wanted);
  return search(wanted, expected);
}

double TimeFinder::contrast(double root, const Wanted& wanted) const {
  const auto pixel = wanted.difference.curve->at(root);
  const double ratio = pixel ? to_.field->amplitude_at(*pixel) / (to_.brightness * wanted.amplitude) : 1;
  return ratio > 0 ? std::max(ratio, 1 / ratio) : 1;
}

bool TimeFinder::find_roots(const Wanted& wanted) {
  const TimeDifference& difference = wanted.difference;
  const EpipolarCurve& curve = *difference.curve;
  const auto [far, near] = curve.range();
  const double pixels = (near - far) * std::max(curve.speed(far), curve.speed(near));
  constexpr double longest_curve = 200000;  // beside the epipole a curve can be endless
  const auto count = static_cast<std::size_t>(std::clamp(std::ceil(pixels), 1.0, longest_curve));
  const double step = (near - far) / static_cast<double>(count);
  const Eigen::Vector3f direction = curve.direction().cast<float>(), origin = curve.origin().cast<float>();
  const CurvePlaces line{{direction.x(), direction.y(), direction.z()},
                         {origin.x(), origin.y(), origin.z()},
                         static_cast<float>(far),
                         static_cast<float>(step),
                         count};
  const bool seen =
      search_curve(to_.field->arrays(), curve.view().lens(), line, static_cast<float>(difference.time), changes_);
  roots_.clear();
  for (const std::size_t k : changes_) {
    const double low = far + static_cast<double>(k) * step, high = std::min(low + step, near);
    const double at_low = difference(low), at_high = difference(high);
    if (!(at_low * at_high <= 0)) continue;
    const auto root = solve(difference, {low, high, at_low, at_high}, step);
    const bool known = root && !roots_.empty() && *root - roots_.back() < step;
    if (root && !known) roots_.push_back(*root);
  }
  return seen;
}

Match TimeFinder::search(const Wanted& wanted, double expected) {
  if (!find_roots(wanted)) return Match::none(PixelStatus::outside_view);
  std::erase_if(roots_, [&](double root) { return contrast(root, wanted) > impossible; });
  const auto is_alike = [&](double root) { return contrast(root, wanted) < suspicious; };
  if (std::ranges::any_of(roots_, is_alike)) std::erase_if(roots_, std::not_fn(is_alike));
  if (roots_.empty()) return Match::none(PixelStatus::no_match);
  const auto root = choose(roots_, expected, 1 / wanted.difference.curve->speed(roots_[0]));
  return root ? match_at(*root, wanted) : Match::none(PixelStatus::ambiguous);
}

Match TimeFinder::match_at(double root, const Wanted& wanted) const {
  const TimeDifference& difference = wanted.difference;
  const EpipolarCurve& curve = *difference.curve;
  const auto pixel = curve.at(root);
  if (!pixel) return Match::none(PixelStatus::outside_view);
  // The slope is taken over two pixels where the map allows it: over less, noise would be taken for slope.
  const double step = 1 / curve.speed(root);
  const double here = difference(root), before = difference(root - step), behind = difference(root + step);
  double slope = 0.5 * (behind - before);
  if (std::isnan(slope)) slope = std::isnan(behind) ? here - before : behind - here;
  if (!std::isfinite(slope)) return Match::none(PixelStatus::no_match);
  const double variance = static_cast<double>(wanted.sigma) * wanted.sigma + to_.field->variance_at(*pixel);
  const double sigma_px = std::sqrt(variance) / std::abs(slope);
  if (!(sigma_px <= to_.max_sigma_px)) return Match::none(PixelStatus::ambiguous);
  return {PixelStatus::ok, *pixel, sigma_px, root, slope};
}

}  // namespace pagesweep
