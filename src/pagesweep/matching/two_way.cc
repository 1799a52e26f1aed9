// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/two_way.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "pagesweep/base/parallel.h"
#include "pagesweep/matching/agreement.h"

namespace pagesweep {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// One camera's pixels and the other camera's picture.
struct Direction {
  const RayTable* from;
  const RayTable* to;
  const Matcher* matcher;
  EpipolarGeometry everywhere{*from, *to, {0, 0}};

  EpipolarGeometry geometry(InverseDepthRange range) const { return everywhere.within(range); }
};

Match find(const Matcher& matcher, const EpipolarGeometry& geometry, MatchFinder& finder, int x, int y,
           double expected) {
  const PixelStatus status = matcher.status_of(x, y);
  if (status != PixelStatus::ok) return Match::none(status);
  const EpipolarCurve curve = geometry.curve(x, y);
  if (curve.range().empty()) return Match::none(PixelStatus::outside_view);
  return finder.find(x, y, curve, expected);
}

/// What the options allow: from a tenth of the cameras' distance to infinity where they say nothing.
InverseDepthRange allowed_range(const Camera& first, const Camera& second, const MatchOptions& options) {
  const double baseline = (first.center() - second.center()).norm();
  if (!(baseline > 0)) throw std::invalid_argument("matching needs two cameras at different places");
  if (options.near_mm < 0 || options.far_mm < 0 || (options.far_mm > 0 && !(options.near_mm < options.far_mm)))
    throw std::invalid_argument("matching: the depth range must have 0 <= near < far");
  return {options.far_mm > 0 ? 1 / options.far_mm : 0, options.near_mm > 0 ? 1 / options.near_mm : 10 / baseline};
}

/// Depths in one camera and in the other.
struct DepthRanges {
  InverseDepthRange there, back;
};

/// Inverse depths of a grid of pixels, kept if the matched pixel's own match leads back.
std::vector<double> probe_depths(const Direction& there, const Direction& back, const DepthRanges& ranges, int probes) {
  const EpipolarGeometry geometry = there.geometry(ranges.there), return_geometry = back.geometry(ranges.back);
  const int width = there.from->width(), height = there.from->height();
  const int stride = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(width) * height / probes)));
  std::vector<std::vector<double>> rows(static_cast<std::size_t>((height + stride - 1) / stride));
  parallel_rows(static_cast<int>(rows.size()), [&](int row) {
    const auto finder = there.matcher->make_finder(), return_finder = back.matcher->make_finder();
    for (int x = stride / 2; x < width; x += stride) {
      const int y = std::min(row * stride + stride / 2, height - 1);
      const Match match = find(*there.matcher, geometry, *finder, x, y, nan);
      if (match.status != PixelStatus::ok) continue;
      const int u = std::clamp(static_cast<int>(std::lround(match.pixel.x())), 0, there.to->width() - 1);
      const int v = std::clamp(static_cast<int>(std::lround(match.pixel.y())), 0, there.to->height() - 1);
      const Match returned = find(*back.matcher, return_geometry, *return_finder, u, v, nan);
      const bool agrees = returned.status == PixelStatus::ok && (returned.pixel - Eigen::Vector2d(x, y)).norm() < 3;
      if (agrees) rows[static_cast<std::size_t>(row)].push_back(match.inverse_depth);
    }
  });
  std::vector<double> depths;
  for (const auto& row : rows) depths.insert(depths.end(), row.begin(), row.end());
  return depths;
}

/// The depths that the scene shows, but for a thousandth at either end, and some more. A range that is too wide costs
/// time and a few more ambiguous pixels; one that is too narrow costs the truth.
/// \param more  as a share of them
InverseDepthRange narrow(InverseDepthRange allowed, std::vector<double> depths, double more) {
  constexpr std::size_t enough = 100;
  if (depths.size() < enough) return allowed;
  std::sort(depths.begin(), depths.end());
  const std::size_t tail = depths.size() / 1000;
  const double far = depths[tail], near = depths[depths.size() - 1 - tail];
  const double margin = more * (near - far + 0.1 * near);
  return {std::max(allowed.far, far - margin), std::min(allowed.near, near + margin)};
}

/// Few pixels look along their whole curves; many look where those found something, and far around it.
DepthRanges find_ranges(const Direction& there, const Direction& back, InverseDepthRange allowed) {
  DepthRanges ranges{allowed, allowed};
  for (const auto& [probes, more] : {std::pair{1000, 1.0}, {5000, 0.2}}) {
    const DepthRanges before = ranges;
    ranges.there = narrow(allowed, probe_depths(there, back, before, probes), more);
    ranges.back = narrow(allowed, probe_depths(back, there, {before.back, before.there}, probes), more);
  }
  return ranges;
}

constexpr int rows_at_once = 16;

Correspondences match_one_way(const Direction& direction, InverseDepthRange range, Progress& progress) {
  constexpr int band = 8 * rows_at_once;  // rows between two reports of progress
  const EpipolarGeometry geometry = direction.geometry(range);
  Correspondences matches(direction.from->width(), direction.from->height());
  progress.begin(fmt::format("matching {} with {}", direction.from->camera().name, direction.to->camera().name));
  for (int top = 0; top < matches.height(); top += band) {
    const int rows = std::min(band, matches.height() - top);
    parallel_ranges(rows, rows_at_once, [&](int begin, int end) {
      direction.matcher->match_rows(geometry, top + begin, top + end, matches);
    });
    progress.advance(static_cast<double>(top + rows) / matches.height());
  }
  return matches;
}

}  // namespace

void put(const Match& match, int x, int y, Correspondences& matches) {
  matches.status(x, y) = match.status;
  if (match.status != PixelStatus::ok) return;
  matches.u(x, y) = static_cast<float>(match.pixel.x());
  matches.v(x, y) = static_cast<float>(match.pixel.y());
  matches.sigma(x, y) = static_cast<float>(match.sigma_px);
  matches.slope(x, y) = static_cast<float>(match.slope);
}

void Matcher::match_rows(const EpipolarGeometry& geometry, int top, int bottom, Correspondences& matches) const {
  const auto finder = make_finder();
  const auto rows = static_cast<std::size_t>(bottom - top);
  std::array<double, rows_at_once> expected;
  std::array<Match, rows_at_once> column;
  expected.fill(nan);
  for (int x = 0; x < matches.width(); ++x) {
    column.fill(Match::none(PixelStatus::not_computed));
    finder->find_quickly(x, top, geometry, std::span(expected).first(rows), std::span(column).first(rows));
    for (std::size_t row = 0; row < rows; ++row) {
      const int y = top + static_cast<int>(row);
      Match& match = column[row];
      if (match.status == PixelStatus::not_computed) match = find(*this, geometry, *finder, x, y, expected[row]);
      put(match, x, y, matches);
      if (match.status == PixelStatus::ok) expected[row] = match.inverse_depth;
    }
  }
}

MatchPair match_both_ways(const RayTable& first, const RayTable& second, const Matcher& from_first,
                          const Matcher& from_second, const MatchOptions& options, Progress& progress) {
  const InverseDepthRange allowed = allowed_range(first.camera(), second.camera(), options);
  const Direction there{&first, &second, &from_first}, back{&second, &first, &from_second};
  const bool known = options.near_mm > 0 && options.far_mm > 0;
  progress.begin("looking for the range of depths");
  const DepthRanges ranges = known ? DepthRanges{allowed, allowed} : find_ranges(there, back, allowed);
  MatchPair pair{match_one_way(there, ranges.there, progress), match_one_way(back, ranges.back, progress)};
  keep_agreeing(pair, options.max_disagreement_px);
  return pair;
}

}  // namespace pagesweep
