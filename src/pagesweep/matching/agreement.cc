// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/agreement.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

/// The pixels around a position and their bilinear weights.
struct Cell {
  std::array<int, 4> x, y;
  std::array<double, 4> weight;
};

Cell cell_around(double u, double v, int width, int height) {
  u = std::clamp(u, 0.0, width - 1.0);
  v = std::clamp(v, 0.0, height - 1.0);
  const int left = static_cast<int>(u), top = static_cast<int>(v);
  const int right = std::min(left + 1, width - 1), bottom = std::min(top + 1, height - 1);
  const double a = u - left, b = v - top;
  return {{left, right, left, right}, {top, top, bottom, bottom}, {(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b}};
}

/// One direction's matches, and their status before they were compared.
struct Found {
  Correspondences* matches;
  const Image<PixelStatus>* status;
};

/// Whether the match of pixel (x, y) is confirmed from the other side.
bool is_confirmed(const Correspondences& matches, const Found& other, int x, int y, double max_px) {
  const Correspondences& back = *other.matches;
  const double u = matches.u(x, y), v = matches.v(x, y);
  const Cell cell = cell_around(u, v, back.width(), back.height());
  double weights = 0, du = 0, dv = 0, sigma = 0;
  int out_of_view = 0, found = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const int cx = cell.x[i], cy = cell.y[i];
    const PixelStatus status = (*other.status)(cx, cy);
    out_of_view += status == PixelStatus::outside_view ? 1 : 0;
    if (status != PixelStatus::ok) continue;
    // A step of one picture is about the same step of the other, which serves where corners are missing.
    const double weight = cell.weight[i] + 1e-6;
    weights += weight;
    du += weight * (back.u(cx, cy) + (u - cx) - x);
    dv += weight * (back.v(cx, cy) + (v - cy) - y);
    sigma += weight * back.sigma(cx, cy);
    ++found;
  }
  if (found == 0) return out_of_view == 4;
  // With all four corners the steps cancel; one that is missing leaves up to a pixel of foreshortening in doubt.
  const double doubt = found == 4 ? 0 : 0.5, distance_squared = du * du + dv * dv;
  const double least_tolerance = (max_px + doubt) * weights;
  if (distance_squared <= least_tolerance * least_tolerance) return true;
  const double own_sigma = matches.sigma(x, y), their_sigma = sigma / weights;
  const double sigmas = 4 * std::sqrt(own_sigma * own_sigma + their_sigma * their_sigma);
  const double tolerance = (std::max(max_px, sigmas) + doubt) * weights;
  return distance_squared <= tolerance * tolerance;
}

void judge(const Found& there, const Found& back, double max_px, const PixelSet* only) {
  Correspondences& matches = *there.matches;
  parallel_rows(matches.height(), [&](int y) {
    if (!any_takes_part(only, y)) return;
    for (int x = 0; x < matches.width(); ++x) {
      if (!takes_part(only, x, y) || (*there.status)(x, y) != PixelStatus::ok) continue;
      const bool confirmed = is_confirmed(matches, back, x, y, max_px);
      matches.status(x, y) = confirmed ? PixelStatus::ok : PixelStatus::inconsistent;
    }
  });
}

}  // namespace

void keep_agreeing(MatchPair& pair, const FoundStatus& found, double max_px, const PixelSets& only) {
  const Found first{&pair.from_first, &found.first}, second{&pair.from_second, &found.second};
  judge(first, second, max_px, only.first);
  judge(second, first, max_px, only.second);
}

}  // namespace pagesweep
