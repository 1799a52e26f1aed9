// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/two_way.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <thread>
#include <utility>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// What the options allow: from a tenth of the cameras' distance to infinity where they say nothing.
InverseDepthRange allowed_range(const Camera& first, const Camera& second, const MatchOptions& options) {
  const double baseline = (first.center() - second.center()).norm();
  if (!(baseline > 0)) throw std::invalid_argument("matching needs two cameras at different places");
  if (options.near_mm < 0 || options.far_mm < 0 || (options.far_mm > 0 && !(options.near_mm < options.far_mm)))
    throw std::invalid_argument("matching: the depth range must have 0 <= near < far");
  return {options.far_mm > 0 ? 1 / options.far_mm : 0, options.near_mm > 0 ? 1 / options.near_mm : 10 / baseline};
}

/// The depths that the scene shows, but for a thousandth at either end, and some more. A range that is too wide costs
/// time and a few more ambiguous pixels; one that is too narrow costs the truth.
/// \param more  as a share of them
InverseDepthRange narrow(InverseDepthRange allowed, std::vector<double> depths, double more) {
  constexpr std::size_t enough = 100;
  if (depths.size() < enough) return allowed;
  std::ranges::sort(depths);
  const std::size_t tail = depths.size() / 1000;
  const double far = depths[tail], near = depths[depths.size() - 1 - tail];
  const double margin = more * (near - far + 0.1 * near);
  return {std::max(allowed.far, far - margin), std::min(allowed.near, near + margin)};
}

constexpr int rows_at_once = 16;

}  // namespace

/// One camera's pixels and their curves in the other camera.
struct TwoWayMatching::Direction {
  const PixelMatcher& matcher;
  const EpipolarGeometry& everywhere;

  EpipolarGeometry geometry(InverseDepthRange range) const { return everywhere.within(range); }
};

void put(const Match& match, int x, int y, Correspondences& matches) {
  matches.status(x, y) = match.status;
  if (match.status != PixelStatus::ok) {
    matches.u(x, y) = not_a_number;
    return;
  }
  matches.u(x, y) = static_cast<float>(match.pixel.x());
  matches.v(x, y) = static_cast<float>(match.pixel.y());
  matches.sigma(x, y) = static_cast<float>(match.sigma_px);
  matches.slope(x, y) = static_cast<float>(match.slope);
}

Match find_match(const EpipolarGeometry& geometry, MatchFinder& finder, int x, int y, double expected) {
  const EpipolarCurve curve = geometry.curve(x, y);
  if (curve.range().empty()) return Match::none(PixelStatus::outside_view);
  return finder.find(x, y, curve, expected);
}

/// Inverse depths of the wanted ones of a grid of the first camera's pixels, and of those that they match, if these
/// lead back. They join those that are known.
void TwoWayMatching::probe(const Direction& there, const Direction& back, const DepthRanges& ranges, int probes,
                           Probes& found) const {
  const EpipolarGeometry there_geometry = there.geometry(ranges.there), return_geometry = back.geometry(ranges.back);
  const int width = first_.width(), height = first_.height();
  const int stride = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(width) * height / probes)));
  std::vector<Probes> rows(static_cast<std::size_t>((height + stride - 1) / stride));
  parallel_rows(static_cast<int>(rows.size()), [&](int row) {
    const auto finder = there.matcher.make_finder(), return_finder = back.matcher.make_finder();
    for (int x = stride / 2; x < width; x += stride) {
      const int y = std::min(row * stride + stride / 2, height - 1);
      if (!there.matcher.is_wanted(x, y) || there.matcher.status_of(x, y) != PixelStatus::ok) continue;
      const Match match = find_match(there_geometry, *finder, x, y, nan);
      if (match.status != PixelStatus::ok) continue;
      const int u = std::clamp(static_cast<int>(std::lround(match.pixel.x())), 0, second_.width() - 1);
      const int v = std::clamp(static_cast<int>(std::lround(match.pixel.y())), 0, second_.height() - 1);
      if (back.matcher.status_of(u, v) != PixelStatus::ok) continue;
      const Match returned = find_match(return_geometry, *return_finder, u, v, nan);
      const bool agrees = returned.status == PixelStatus::ok && (returned.pixel - Eigen::Vector2d(x, y)).norm() < 3;
      if (!agrees) continue;
      rows[static_cast<std::size_t>(row)].there.push_back(match.inverse_depth);
      rows[static_cast<std::size_t>(row)].back.push_back(returned.inverse_depth);
    }
  });
  for (const Probes& row : rows) {
    found.there.insert(found.there.end(), row.there.begin(), row.there.end());
    found.back.insert(found.back.end(), row.back.begin(), row.back.end());
  }
}

/// Few pixels look along their whole curves; many look where those found something, and far around it.
TwoWayMatching::DepthRanges TwoWayMatching::find_ranges(const Direction& there, const Direction& back) {
  DepthRanges ranges{allowed_, allowed_};
  const auto look = [&](Probes& found, int probes, double more) {
    probe(there, back, ranges, probes, found);
    ranges = {narrow(allowed_, found.there, more), narrow(allowed_, found.back, more)};
  };
  look(few_, 1000, 1.0);
  look(many_, 5000, 0.2);
  return ranges;
}

void TwoWayMatching::match_one_way(const Direction& direction, InverseDepthRange range, Progress& progress,
                                   Correspondences& matches) {
  const EpipolarGeometry geometry = direction.geometry(range);
  progress.begin(fmt::format("matching {} with {}", geometry.from().camera().name, geometry.to().camera().name));
  // Nobody waits until all others are as far: this thread tells for all of them.
  const std::thread::id reporter = std::this_thread::get_id();
  std::atomic<int> rows_done = 0;
  parallel_ranges(matches.height(), rows_at_once, [&](int begin, int end) {
    bool any = false;
    for (int y = begin; y < end; ++y) any = any || direction.matcher.wants_any_of(y);
    if (any) direction.matcher.match_rows(geometry, begin, end, matches);
    const int rows = rows_done += end - begin;
    if (std::this_thread::get_id() == reporter) progress.advance(static_cast<double>(rows) / matches.height());
  });
  progress.advance(1);
}

TwoWayMatching::TwoWayMatching(const RayTable& first, const RayTable& second, const MatchOptions& options)
    : first_(first),
      second_(second),
      max_disagreement_px_(options.max_disagreement_px),
      allowed_(allowed_range(first.camera(), second.camera(), options)),
      range_is_known_(options.near_mm > 0 && options.far_mm > 0),
      there_(first, second, {}),
      back_(second, first, {}) {
  pair_ = {Correspondences(first.width(), first.height()), Correspondences(second.width(), second.height())};
  found_ = {pair_.from_first.status, pair_.from_second.status};
}

void TwoWayMatching::match(const PixelMatcher& from_first, const PixelMatcher& from_second, Progress& progress) {
  const Direction there{from_first, there_}, back{from_second, back_};
  progress.begin("looking for the range of depths");
  const DepthRanges ranges = range_is_known_ ? DepthRanges{allowed_, allowed_} : find_ranges(there, back);
  const auto match = [&](const Direction& direction, InverseDepthRange range, Correspondences& matches,
                         Image<PixelStatus>& found) {
    match_one_way(direction, range, progress, matches);
    parallel_rows(matches.height(), [&](int y) {
      if (!direction.matcher.wants_any_of(y)) return;
      for (int x = 0; x < matches.width(); ++x)
        if (direction.matcher.is_wanted(x, y)) found(x, y) = matches.status(x, y);
    });
  };
  match(there, ranges.there, pair_.from_first, found_.first);
  match(back, ranges.back, pair_.from_second, found_.second);
}

MatchPair TwoWayMatching::matches() && {
  for (Correspondences* matches : {&pair_.from_first, &pair_.from_second})
    parallel_rows(matches->height(), [&](int y) {
      for (int x = 0; x < matches->width(); ++x) {
        if (matches->status(x, y) == PixelStatus::ok) continue;
        matches->u(x, y) = matches->v(x, y) = not_a_number;
        matches->sigma(x, y) = matches->slope(x, y) = not_a_number;
      }
    });
  return std::move(pair_);
}

MatchPair match_both_ways(const RayTable& first, const RayTable& second, const PixelMatcher& from_first,
                          const PixelMatcher& from_second, const MatchOptions& options, Progress& progress) {
  TwoWayMatching matching(first, second, options);
  matching.match(from_first, from_second, progress);
  matching.keep_agreeing({});
  return std::move(matching).matches();
}

}  // namespace pagesweep
