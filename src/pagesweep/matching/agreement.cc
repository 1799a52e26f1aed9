// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/agreement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "pagesweep/base/parallel.h"

// Not worth their time to compile beside SSE4, AVX2 and AVX-512.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/matching/agreement.cc"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

#include "pagesweep/matching/picture_lookup_internal.h"

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace {

/// Whether the matches of a row of pixels are clearly confirmed, one byte each: by all four pixels around their place,
/// to within max_px.
void ConfirmRow(const Correspondences& matches, const Correspondences& back, int y, double max_px,
                std::uint8_t* confirmed) {
  const Floats d;
  const float *u = matches.u.row(y).data(), *v = matches.v.row(y).data();
  const auto width = static_cast<std::size_t>(matches.width()), lanes = hn::Lanes(d);
  const Vector row = set(static_cast<float>(y)), most = set(static_cast<float>(max_px * max_px));
  const auto within = [](Vector p, int end) { return hn::Min(hn::Max(p, set(0)), set(static_cast<float>(end - 1))); };
  for (std::size_t x = 0; x < width; x += lanes) {
    const std::size_t first = std::min(x, width - lanes);  // the last ones once more
    const Place place = place_at(hn::LoadU(d, u + first), hn::LoadU(d, v + first), back.width(), back.height());
    const SideBySide pixels(back.width(), back.height(), place);
    const auto miss = [&](const Image<float>& picture, Vector at, int end, Vector own) {
      return hn::Sub(hn::Add(between(pixels.corners(picture.data()), place), hn::Sub(at, within(at, end))), own);
    };
    const Vector column = hn::Add(hn::Iota(d, 0), set(static_cast<float>(first)));
    const Vector du = miss(back.u, place.u, back.width(), column), dv = miss(back.v, place.v, back.height(), row);
    const Mask near = hn::And(place.inside, hn::Le(hn::MulAdd(du, du, hn::Mul(dv, dv)), most));
    HWY_ALIGN float is_near[most_places];
    hn::Store(hn::IfThenElseZero(near, set(1)), d, is_near);
    for (std::size_t k = 0; k < lanes; ++k) confirmed[first + k] = is_near[k] > 0;
  }
}

}  // namespace
}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {
namespace {

HWY_EXPORT(ConfirmRow);

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
  const bool at_once = std::min(matches.width(), back.matches->width()) >= 16 && back.matches->height() >= 2;
  parallel_rows(matches.height(), [&](int y) {
    if (!any_takes_part(only, y)) return;
    std::vector<std::uint8_t> clear(static_cast<std::size_t>(matches.width()));
    if (at_once) HWY_DYNAMIC_DISPATCH(ConfirmRow)(matches, *back.matches, y, max_px, clear.data());
    for (int x = 0; x < matches.width(); ++x) {
      if (!takes_part(only, x, y) || (*there.status)(x, y) != PixelStatus::ok) continue;
      const bool confirmed = clear[static_cast<std::size_t>(x)] || is_confirmed(matches, back, x, y, max_px);
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
#endif  // HWY_ONCE
