// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <vector>

#include "pagesweep/base/parallel.h"
#include "pagesweep/dewarping/text_direction_internal.h"

namespace pagesweep {
namespace {

struct Ink {
  float x, y;  ///< [px] from the middle of the page
  float amount;
};

/// Where the page is darker than both above and below: text, but hardly the borders of pictures or of the paper.
std::vector<Ink> find_ink(const Image<float>& brightness) {
  constexpr int reach = 4;
  constexpr float least_difference = 0.1f;
  std::vector<Ink> ink;
  for (int y = reach; y < brightness.height() - reach; ++y)
    for (int x = 0; x < brightness.width(); ++x) {
      const float above = brightness(x, y - reach) - brightness(x, y);
      const float below = brightness(x, y + reach) - brightness(x, y);
      if (!(above > least_difference && below > least_difference)) continue;  // NaN is no ink
      const float darker = std::min(above, below);
      ink.push_back(
          {float(x) - 0.5f * float(brightness.width()), float(y) - 0.5f * float(brightness.height()), darker});
    }
  return ink;
}

/// How sharp the profile is: the sum of squared differences of neighbouring groups of three bins. Single bins would see
/// the pixels' own grid, in which all directions but 0 are a little blurred.
double sharpness(const std::vector<Ink>& ink, double angle_rad, int reach) {
  std::vector<double> profile(static_cast<std::size_t>(2 * reach + 3));
  const auto c = static_cast<float>(std::cos(angle_rad)), s = static_cast<float>(std::sin(angle_rad));
  for (const Ink& spot : ink) {
    const float across = spot.y * c - spot.x * s + float(reach);
    const float bin = std::floor(across);
    profile[static_cast<std::size_t>(bin)] += spot.amount * (bin + 1 - across);
    profile[static_cast<std::size_t>(bin) + 1] += spot.amount * (across - bin);
  }
  double sum = 0;
  const auto group = [&](std::size_t i) { return profile[i] + profile[i + 1] + profile[i + 2]; };
  for (std::size_t i = 0; i + 5 < profile.size(); ++i) sum += std::pow(group(i + 3) - group(i), 2);
  return sum;
}

/// Sharpness at `count` directions on either side of `middle`.
std::vector<double> scan_directions(const std::vector<Ink>& ink, double middle, double step, int count, int reach) {
  std::vector<double> values(static_cast<std::size_t>(2 * count + 1));
  parallel_rows(2 * count + 1, [&](int i) {
    values[static_cast<std::size_t>(i)] = sharpness(ink, middle + (i - count) * step, reach);
  });
  return values;
}

/// Signed position of the largest value, counted from the middle one.
int find_peak(const std::vector<double>& values) {
  const auto best = std::max_element(values.begin(), values.end()) - values.begin();
  return static_cast<int>(best) - static_cast<int>(values.size() / 2);
}

bool stands_out(std::vector<double> values) {
  constexpr double least_ratio = 2;  // noise reaches 1.6, a page of text 50
  const double best = *std::max_element(values.begin(), values.end());
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return best > least_ratio * *middle;
}

}  // namespace

std::optional<double> find_text_direction(const Image<float>& brightness, double max_rad) {
  constexpr std::size_t least_ink = 500;
  constexpr int coarse_count = 200;
  const std::vector<Ink> ink = find_ink(brightness);
  if (ink.size() < least_ink) return std::nullopt;
  const int reach = 1 + static_cast<int>(0.5 * std::hypot(brightness.width(), brightness.height()));
  double step = max_rad / coarse_count;
  const std::vector<double> coarse = scan_directions(ink, 0, step, coarse_count, reach);
  const int peak = find_peak(coarse);
  if (std::abs(peak) == coarse_count || !stands_out(coarse)) return std::nullopt;
  double angle = peak * step;
  while (step > 1e-4) {  // 0.02 mm over a page's width
    step /= 4;
    angle += step * find_peak(scan_directions(ink, angle, step, 8, reach));
  }
  return angle;
}

}  // namespace pagesweep
