// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/quality/line_straightness.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

constexpr double strip_mm = 6, tallest_mm = 1.2;  // a baseline falls off within that
constexpr double jump_mm = 0.35;                  // from one strip to the next
constexpr double least_line_mm = 60, window_mm = 100;
constexpr double least_ink = 0.04;  // share of a strip's width that is ink just above a baseline

struct Baseline {
  std::vector<double> x_mm, y_mm;
};

double quantile(std::vector<double> values, double share) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * double(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Ink in each row of a strip: share of its width that is darker than half the strip's paper.
std::vector<double> ink_profile(const Image<float>& light, int x0, int x1) {
  std::vector<float> bright;
  for (int y = 0; y < light.height(); y += 4)
    for (int x = x0; x < x1; x += 4)
      if (std::isfinite(light(x, y))) bright.push_back(light(x, y));
  std::vector<double> profile(static_cast<std::size_t>(light.height()), 0.0);
  if (bright.size() < 16) return profile;
  const auto at = bright.begin() + static_cast<std::ptrdiff_t>(0.85 * double(bright.size()));
  std::nth_element(bright.begin(), at, bright.end());
  const float paper = *at;
  for (int y = 0; y < light.height(); ++y)
    for (int x = x0; x < x1; ++x) {
      // Gray in between counts in part, so that the profile falls off as smoothly as the picture does.
      const float dark = 1 - light(x, y) / paper;
      if (dark > 0.1f) profile[static_cast<std::size_t>(y)] += std::min(1.0, double(dark)) / (x1 - x0);
    }
  return profile;
}

/// Places [px] at which a strip's ink falls off steeply.
std::vector<double> find_falls(const std::vector<double>& profile, double pixels_per_mm) {
  const int half = std::max(1, static_cast<int>(std::lround(0.12 * pixels_per_mm)));
  const int reach = std::max(2, static_cast<int>(tallest_mm * pixels_per_mm));
  const int height = static_cast<int>(profile.size());
  std::vector<double> fall(profile.size(), 0.0);
  for (int y = 2 * half; y + 2 * half < height; ++y)
    for (int k = 0; k < 2 * half; ++k)
      fall[static_cast<std::size_t>(y)] +=
          (profile[static_cast<std::size_t>(y - 1 - k)] - profile[static_cast<std::size_t>(y + k)]) / (2 * half);
  std::vector<double> places;
  for (int y = reach; y + reach < height; ++y) {
    const auto n = static_cast<std::size_t>(y);
    if (!(fall[n] > least_ink)) continue;
    const auto from = fall.begin() + (y - reach), to = fall.begin() + (y + reach + 1);
    if (std::max_element(from, to) != fall.begin() + y) continue;
    const double a = fall[n - 1], b = fall[n], c = fall[n + 1];
    const double bend = a - 2 * b + c;
    places.push_back(y - 0.5 + (bend < 0 ? 0.5 * (a - c) / bend : 0));
  }
  return places;
}

/// Follows baselines from strip to strip; one that skips more than one strip ends.
std::vector<Baseline> follow(const std::vector<std::vector<double>>& strips, double pixels_per_mm) {
  struct Open {
    Baseline line;
    std::size_t last;
  };
  std::vector<Open> open;
  for (std::size_t k = 0; k < strips.size(); ++k)
    for (const double place : strips[k]) {
      const double y = place / pixels_per_mm;
      Open* nearest = nullptr;
      double distance = jump_mm;
      for (Open& line : open)
        if (line.last < k && k - line.last <= 2 && std::abs(line.line.y_mm.back() - y) < distance) {
          distance = std::abs(line.line.y_mm.back() - y);
          nearest = &line;
        }
      if (!nearest) nearest = &open.emplace_back();
      nearest->last = k;
      nearest->line.x_mm.push_back((double(k) + 0.5) * strip_mm);
      nearest->line.y_mm.push_back(y);
    }
  std::vector<Baseline> lines;
  for (Open& line : open)
    if (line.line.x_mm.back() - line.line.x_mm.front() >= least_line_mm) lines.push_back(std::move(line.line));
  return lines;
}

/// Straight line through places from `from` to before `to`, once more without what lies off it: slope and deviations.
struct Straight {
  double slope = 0;
  std::vector<double> off_mm;  ///< of all of them
};
Straight fit_straight(const Baseline& line, std::size_t from, std::size_t to) {
  Straight fit;
  double slope = 0, at = 0;
  double limit = 1e9;
  for (int round = 0; round < 3; ++round) {
    double n = 0, x1 = 0, y1 = 0, xx = 0, xy = 0;
    for (std::size_t k = from; k < to; ++k) {
      const double x = line.x_mm[k] - line.x_mm[from], y = line.y_mm[k];
      if (std::abs(y - at - slope * x) > limit) continue;
      n += 1, x1 += x, y1 += y, xx += x * x, xy += x * y;
    }
    const double spread = n * xx - x1 * x1;
    if (n < 4 || !(spread > 0)) break;
    slope = (n * xy - x1 * y1) / spread;
    at = (y1 - slope * x1) / n;
    limit = 0.2;
  }
  fit.slope = slope;
  for (std::size_t k = from; k < to; ++k)
    fit.off_mm.push_back(line.y_mm[k] - at - slope * (line.x_mm[k] - line.x_mm[from]));
  return fit;
}

/// Largest deviation within a window, of the means of three neighbours.
double largest_smooth(const std::vector<double>& off) {
  double largest = 0;
  for (std::size_t k = 1; k + 1 < off.size(); ++k)
    largest = std::max(largest, std::abs(off[k - 1] + off[k] + off[k + 1]) / 3);
  return largest;
}

}  // namespace

LineStraightness measure_lines(const Image<float>& light, double pixels_per_mm) {
  LineStraightness result;
  const double width_px = strip_mm * pixels_per_mm;
  const int count = static_cast<int>(light.width() / width_px);
  std::vector<std::vector<double>> strips(static_cast<std::size_t>(std::max(0, count)));
  parallel_rows(count, [&](int k) {
    strips[static_cast<std::size_t>(k)] = find_falls(
        ink_profile(light, static_cast<int>(k * width_px), static_cast<int>((k + 1) * width_px)), pixels_per_mm);
  });
  std::vector<double> slopes, windows;
  double squares = 0, places = 0;
  for (const Baseline& line : follow(strips, pixels_per_mm)) {
    const Straight whole = fit_straight(line, 0, line.x_mm.size());
    std::vector<double> sizes;
    for (const double off : whole.off_mm) sizes.push_back(std::abs(off));
    if (quantile(sizes, 0.5) > 0.25) continue;  // no text line: the border of a picture, a curve
    ++result.lines;
    slopes.push_back(whole.slope);
    for (const double off : whole.off_mm)
      if (std::abs(off) < 0.5) squares += off * off, places += 1;
    for (std::size_t from = 0; from < line.x_mm.size(); from += 4) {
      std::size_t to = from;
      while (to < line.x_mm.size() && line.x_mm[to] - line.x_mm[from] <= window_mm) ++to;
      if (line.x_mm[to - 1] - line.x_mm[from] < 0.5 * window_mm) break;
      windows.push_back(largest_smooth(fit_straight(line, from, to).off_mm));
    }
  }
  if (result.lines == 0 || windows.empty()) return {};
  result.rms_mm = std::sqrt(squares / std::max(1.0, places));
  result.largest_in_100_mm = quantile(windows, 0.95);
  result.skew_rad = quantile(slopes, 0.5);
  return result;
}

}  // namespace pagesweep
