// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/pairwise.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

constexpr int paper_interval = 30;  // [frames] of the paper's Fig. 4

/// A sample as Frames::read_row() would give it.
float sample_at(const Frames& frames, int x, int y, int i, bool keep_clipped) {
  if (!frames.has(i)) return not_a_number;
  const double gray = std::visit([&](const auto& image) { return static_cast<double>(image(x, y)); }, frames.frame(i));
  const Sequence& sequence = frames.sequence();
  if (gray >= sequence.saturation && !keep_clipped) return std::numeric_limits<float>::infinity();
  return static_cast<float>((gray - sequence.black_level) / sequence.exposure(i));
}

/// Gray value between four pixels; not finite if one of them is not (0 times infinity is NaN: no measurement either).
float sample_between(const Frames& frames, double u, double v, int i, bool keep_clipped) {
  const int x = std::clamp(static_cast<int>(std::floor(u)), 0, std::max(0, frames.width() - 2));
  const int y = std::clamp(static_cast<int>(std::floor(v)), 0, std::max(0, frames.height() - 2));
  const auto s = static_cast<float>(u - x), t = static_cast<float>(v - y);
  const auto at = [&](int dx, int dy) {
    return sample_at(frames, std::min(x + dx, frames.width() - 1), std::min(y + dy, frames.height() - 1), i,
                     keep_clipped);
  };
  const float top = (1 - s) * at(0, 0) + s * at(1, 0), bottom = (1 - s) * at(0, 1) + s * at(1, 1);
  return (1 - t) * top + t * bottom;
}

/// Gradient of the time map [frames/px] around a place, from the plane through its good pixels; zero if there are too
/// few.
Eigen::Vector2d gradient_at(const TimeMap& times, double u, double v) {
  constexpr int reach = 2;
  const int cx = static_cast<int>(std::lround(u)), cy = static_cast<int>(std::lround(v));
  double n = 0, sx = 0, sy = 0, st = 0, sxx = 0, sxy = 0, syy = 0, sxt = 0, syt = 0;
  for (int dy = -reach; dy <= reach; ++dy)
    for (int dx = -reach; dx <= reach; ++dx) {
      const int x = cx + dx, y = cy + dy;
      if (!times.time.contains(x, y) || times.status(x, y) != PixelStatus::ok) continue;
      const double t = times.time(x, y);
      n += 1, sx += dx, sy += dy, st += t;
      sxx += dx * dx, sxy += dx * dy, syy += dy * dy, sxt += dx * t, syt += dy * t;
    }
  if (n < 6) return Eigen::Vector2d::Zero();
  const double xx = sxx - sx * sx / n, xy = sxy - sx * sy / n, yy = syy - sy * sy / n;
  const double xt = sxt - sx * st / n, yt = syt - sy * st / n;
  const double determinant = xx * yy - xy * xy;
  if (determinant < 1e-6 * (xx * yy + 1e-12)) return Eigen::Vector2d::Zero();
  return {(yy * xt - xy * yt) / determinant, (xx * yt - xy * xt) / determinant};
}

/// \param g  memory for one gray value sequence
void shift_match(Correspondences& matches, int x, int y, std::span<const float> f, const Frames& to,
                 const TimeMap& to_times, bool keep_clipped, std::vector<float>& g) {
  const double u = matches.u(x, y), v = matches.v(x, y);
  const Eigen::Vector2d gradient = gradient_at(to_times, u, v);
  const double steepness = gradient.squaredNorm();
  if (!(steepness > 0)) return;
  g.resize(static_cast<std::size_t>(to.count()));
  const int peak = peak_position(f);
  for (int i = 0; i < to.count(); ++i)
    g[static_cast<std::size_t>(i)] =
        std::abs(i - peak) <= paper_interval ? sample_between(to, u, v, i, keep_clipped) : not_a_number;
  const auto shift = match_gray_values(f, g, paper_interval);
  if (!shift || std::abs(shift->c) > 0.25 * paper_interval) return;
  const Eigen::Vector2d move = -shift->c / steepness * gradient;
  if (u + move.x() < 0 || v + move.y() < 0 || u + move.x() > to.width() - 1 || v + move.y() > to.height() - 1) return;
  matches.u(x, y) = static_cast<float>(u + move.x());
  matches.v(x, y) = static_cast<float>(v + move.y());
  matches.sigma(x, y) = static_cast<float>(shift->sigma / std::sqrt(steepness));
}

}  // namespace

std::optional<Shift> match_gray_values(std::span<const float> f, std::span<const float> g, int interval) {
  const int peak = peak_position(f), other_peak = peak_position(g);
  if (peak < 0 || other_peak < 0) return std::nullopt;
  const int begin = std::max(0, peak - interval / 2);
  const int end = std::min(static_cast<int>(f.size()), peak + interval / 2 + 1);
  const auto piece = f.subspan(static_cast<std::size_t>(begin), static_cast<std::size_t>(end - begin));
  auto shift = refine_shift(piece, g, other_peak - peak + begin);
  if (shift) shift->c -= begin;
  return shift;
}

Correspondences shift_pairwise(const Correspondences& matches, const Frames& from, const Frames& to,
                               const TimeMap& to_times, const TimingOptions& options) {
  Correspondences shifted = matches;
  parallel_ranges(matches.height(), 4, [&](int begin, int end) {
    Image<float> samples;
    std::vector<float> f(static_cast<std::size_t>(from.count())), g;
    for (int y = begin; y < end; ++y) {
      from.read_row(y, samples);
      for (int x = 0; x < matches.width(); ++x) {
        if (matches.status(x, y) != PixelStatus::ok) continue;
        const double highest = from.sequence().saturation - from.sequence().black_level;
        for (int i = 0; i < from.count(); ++i) {
          const float gray = samples(x, i);
          const auto naive = static_cast<float>(highest / from.sequence().exposure(i));
          f[static_cast<std::size_t>(i)] = options.use_saturated && std::isinf(gray) ? naive : gray;
        }
        shift_match(shifted, x, y, f, to, to_times, options.use_saturated, g);
      }
    }
  });
  return shifted;
}

}  // namespace pagesweep
