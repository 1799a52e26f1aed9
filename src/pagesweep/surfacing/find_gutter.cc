// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/find_gutter.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace pagesweep {
namespace {

constexpr double band_mm = 6;       // height of the strips that are searched one by one
constexpr double nearest_mm = 1.5;  // the crease itself may be rounded or unmeasured
constexpr double farthest_mm = 13;  // length of the two tangents
constexpr double inlier_mm = 3;
constexpr double steepest_line = 0.25;                  // the gutter is turned by less against the page
constexpr double middle_from = 0.25, middle_to = 0.75;  // share of the paper's width

struct Limits {
  double kink_rad;  // least turn of the paper
  double side_rad;  // least fall of either side
  double depth_mm;  // of the valley below its higher side
  double share;     // of the paper's height that shows it
};
constexpr Limits open_book{0.47, -0.1, 3, 0.6};  // one side may lie flat: the book's first and last pages
constexpr Limits known_book{0.05, -0.3, 0.2, 0.3};

struct Valley {
  double p_mm, q_mm, kink_rad;
};

/// The middle heights of the paper in a band of rows, NaN where it has none.
std::vector<double> profile_of(const HeightField& field, const Image<std::uint8_t>& paper, int from, int to) {
  std::vector<double> profile(static_cast<std::size_t>(field.columns()), not_a_number);
  std::vector<float> heights;
  for (int i = 0; i < field.columns(); ++i) {
    heights.clear();
    for (int j = from; j < to; ++j)
      if (paper(i, j) && std::isfinite(field.z(i, j))) heights.push_back(field.z(i, j));
    if (heights.empty()) continue;
    const auto middle = heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 2);
    std::nth_element(heights.begin(), middle, heights.end());
    profile[static_cast<std::size_t>(i)] = *middle;
  }
  return profile;
}

/// Tangent z = z + slope x on one side of column i, x [mm] from there; nothing if too little is measured.
struct Tangent {
  double z, slope, highest;
};
std::optional<Tangent> tangent(const std::vector<double>& profile, int i, int side, double cell_mm) {
  const int near = static_cast<int>(std::ceil(nearest_mm / cell_mm)), far = static_cast<int>(farthest_mm / cell_mm);
  double n = 0, x1 = 0, x2 = 0, z1 = 0, xz = 0, highest = -1e300;
  for (int k = near; k <= 4 * far; ++k) {
    const int at = i + side * k;
    if (at < 0 || at >= static_cast<int>(profile.size())) break;
    const double z = profile[static_cast<std::size_t>(at)];
    if (!std::isfinite(z)) continue;
    highest = std::max(highest, z);
    if (k > far) continue;
    const double x = side * k * cell_mm;
    n += 1;
    x1 += x;
    x2 += x * x;
    z1 += z;
    xz += x * z;
  }
  const double spread = n * x2 - x1 * x1;
  if (n < 4 || spread < n * n * 2) return std::nullopt;
  const double slope = (n * xz - x1 * z1) / spread;
  return Tangent{(z1 - slope * x1) / n, slope, highest};
}

/// The sharpest valley of a band.
std::optional<Valley> sharpest_valley(const std::vector<double>& profile, const HeightField& field,
                                      const Limits& limits) {
  const auto measured = [](double z) { return std::isfinite(z); };
  const auto first = std::ranges::find_if(profile, measured);
  if (first == profile.end()) return std::nullopt;
  const auto from = static_cast<int>(first - profile.begin());
  const auto to = static_cast<int>(profile.rend() - std::find_if(profile.rbegin(), profile.rend(), measured));
  std::optional<Valley> best;
  for (int i = from + static_cast<int>(middle_from * (to - from)); i < from + middle_to * (to - from); ++i) {
    const auto left = tangent(profile, i, -1, field.cell_mm), right = tangent(profile, i, 1, field.cell_mm);
    if (!left || !right) continue;
    const double fall = -std::atan(left->slope), rise = std::atan(right->slope);
    const double kink = fall + rise;
    if (kink < limits.kink_rad || std::min(fall, rise) < limits.side_rad || (best && kink <= best->kink_rad)) continue;
    const double meet = std::clamp((right->z - left->z) / (left->slope - right->slope), -4.0, 4.0);
    const double bottom = left->z + meet * left->slope;
    if (std::max(left->highest, right->highest) - bottom < limits.depth_mm) continue;
    best = Valley{field.p_of(i) + meet, 0, kink};
  }
  return best;
}

double median_of(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Theil-Sen line through the valleys of all bands, then least squares through those near it.
Gutter line_through(const std::vector<Valley>& valleys, int bands) {
  std::vector<double> slopes{0};
  for (std::size_t a = 0; a < valleys.size(); ++a)
    for (std::size_t b = a + 1; b < valleys.size(); ++b)
      if (const double dq = valleys[b].q_mm - valleys[a].q_mm; dq > 3 * band_mm)
        slopes.push_back((valleys[b].p_mm - valleys[a].p_mm) / dq);
  Gutter gutter;
  gutter.slope = median_of(slopes);
  std::vector<double> offsets;
  for (const Valley& v : valleys) offsets.push_back(v.p_mm - gutter.slope * v.q_mm);
  gutter.p_mm = median_of(offsets);
  double n = 0, q1 = 0, q2 = 0, p1 = 0, qp = 0;
  std::vector<double> kinks;
  for (const Valley& v : valleys) {
    if (std::abs(v.p_mm - gutter.p_mm - gutter.slope * v.q_mm) > inlier_mm) continue;
    n += 1;
    q1 += v.q_mm;
    q2 += v.q_mm * v.q_mm;
    p1 += v.p_mm;
    qp += v.q_mm * v.p_mm;
    kinks.push_back(v.kink_rad);
  }
  const double spread = n * q2 - q1 * q1;
  if (spread > 0) gutter.slope = (n * qp - q1 * p1) / spread;
  gutter.q_mm = q1 / n;
  gutter.p_mm = p1 / n;
  gutter.kink_rad = median_of(kinks);
  gutter.share = n / bands;
  return gutter;
}

}  // namespace

std::optional<Gutter> find_gutter(const HeightField& field, const Image<std::uint8_t>& paper, bool certain) {
  const Limits& limits = certain ? known_book : open_book;
  const int band = std::max(1, static_cast<int>(std::lround(band_mm / field.cell_mm)));
  std::vector<Valley> valleys;
  int bands = 0;
  for (int j = 0; j + band <= field.rows(); j += band) {
    const std::vector<double> profile = profile_of(field, paper, j, j + band);
    if (std::ranges::count_if(profile, [](double z) { return std::isfinite(z); }) * field.cell_mm < 2 * farthest_mm)
      continue;
    ++bands;
    if (auto valley = sharpest_valley(profile, field, limits)) {
      valley->q_mm = field.q_of(j + 0.5 * (band - 1));
      valleys.push_back(*valley);
    }
  }
  if (valleys.size() < 3) return std::nullopt;
  const Gutter gutter = line_through(valleys, bands);
  if (gutter.share < limits.share || std::abs(gutter.slope) > steepest_line) return std::nullopt;
  return gutter;
}

}  // namespace pagesweep
