// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/stripe_width.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pagesweep/base/parallel.h"
#include "pagesweep/data/time_map.h"
#include "pagesweep/timing/row_windows_internal.h"

namespace pagesweep {
namespace {

constexpr int tile_px = 32;
constexpr int row_step = 8, column_step = 3;  // some 40 pixels a tile: half a percent each, a thousandth together

struct Measured {
  double log_width, weight;
};

/// Weighted mean of what is near the weighted median; NaN without any.
float robust_mean(std::vector<Measured>& values) {
  if (values.size() < 3) return not_a_number;
  std::ranges::sort(values, {}, &Measured::log_width);
  double total = 0, passed = 0;
  for (const Measured& value : values) total += value.weight;
  double median = 0;
  for (const Measured& value : values) {
    median = value.log_width;
    if ((passed += value.weight) >= 0.5 * total) break;
  }
  const double spread = values[values.size() * 3 / 4].log_width - values[values.size() / 4].log_width;
  double weight = 0, sum = 0;
  for (const Measured& value : values) {
    if (std::abs(value.log_width - median) > 1.5 * spread + 1e-4) continue;
    weight += value.weight;
    sum += value.weight * value.log_width;
  }
  return static_cast<float>(sum / weight);
}

void measure_row(RowWindows& row, const StripeProfile& profile, const FrameNoise& noise, int width, int y,
                 std::vector<std::vector<Measured>>& tiles) {
  row.read(y);
  for (int x = y / row_step % column_step; x < width; x += column_step) {
    if (row.significance(x) < 15) continue;  // its width would be worth little
    const PixelWindow window = row.window(x, 1);
    const BellFit fit =
        fit_bell(window.gray, window.first_frame, profile, noise, window.start, {.unknowns = BellUnknowns::width});
    if (!fit.converged || fit.reduced_chi_square() > 100) continue;
    // What a model cannot do better than a percent does not count more for being brighter.
    const double variance = fit.covariance(3, 3) + 1e-4;
    if (variance < 0.01)
      tiles[static_cast<std::size_t>(x / tile_px)].push_back({std::log(fit.bell.width), 1 / variance});
  }
}

/// Tiles without a value take the mean of their neighbours that have one, step by step from the border of the known.
void fill(Image<float>& tiles) {
  for (bool changed = true; changed;) {
    changed = false;
    const Image<float> before = tiles;
    for (int y = 0; y < tiles.height(); ++y)
      for (int x = 0; x < tiles.width(); ++x) {
        if (!std::isnan(before(x, y))) continue;
        double sum = 0;
        int known = 0;
        for (int dy = -1; dy <= 1; ++dy)
          for (int dx = -1; dx <= 1; ++dx)
            if (before.contains(x + dx, y + dy) && !std::isnan(before(x + dx, y + dy))) {
              sum += before(x + dx, y + dy);
              ++known;
            }
        if (known == 0) continue;
        tiles(x, y) = static_cast<float>(sum / known);
        changed = true;
      }
  }
  for (float& tile : tiles.pixels())
    if (std::isnan(tile)) tile = 0;
}

}  // namespace

double StripeWidths::at(int x, int y) const {
  float log_width = 0;
  log_row(y, x, {&log_width, 1});
  return std::exp(log_width);
}

void StripeWidths::log_row(int y, int left, std::span<float> log_widths) const {
  std::ranges::fill(log_widths, 0.0F);
  if (log_width_.empty()) return;
  const float per_tile = 1.0F / static_cast<float>(tile_px_);
  const auto place = [&](int pixel, int tiles) {
    return std::clamp((static_cast<float>(pixel) + 0.5F) * per_tile - 0.5F, 0.0F, static_cast<float>(tiles - 1));
  };
  const float v = place(y, log_width_.height());
  const int above = static_cast<int>(v), below = std::min(above + 1, log_width_.height() - 1);
  const auto top = log_width_.row(above), bottom = log_width_.row(below);
  for (std::size_t k = 0; k < log_widths.size(); ++k) {
    const float u = place(left + static_cast<int>(k), log_width_.width());
    const auto i = static_cast<std::size_t>(u), right = std::min(i + 1, top.size() - 1);
    const float upper = top[i] + (u - static_cast<float>(i)) * (top[right] - top[i]);
    const float lower = bottom[i] + (u - static_cast<float>(i)) * (bottom[right] - bottom[i]);
    log_widths[k] = upper + (v - static_cast<float>(above)) * (lower - upper);
  }
}

std::pair<double, double> StripeWidths::range() const {
  if (log_width_.empty()) return {1, 1};
  const auto [low, high] = std::ranges::minmax(log_width_.pixels());
  return {std::exp(low), std::exp(high)};
}

StripeWidths measure_widths(const Frames& frames, const StripeProfile& profile, const SensorNoise& noise) {
  Image<float> tiles((frames.width() + tile_px - 1) / tile_px, (frames.height() + tile_px - 1) / tile_px, not_a_number);
  const FrameNoise frame_noise(noise, frames.sequence().exposures);
  parallel_rows(tiles.height(), [&](int tile_row) {
    RowWindows row(frames, profile, frame_noise);
    std::vector<std::vector<Measured>> values(static_cast<std::size_t>(tiles.width()));
    const int end = std::min(frames.height(), (tile_row + 1) * tile_px);
    for (int y = tile_row * tile_px; y < end; y += row_step)
      measure_row(row, profile, frame_noise, frames.width(), y, values);
    for (int x = 0; x < tiles.width(); ++x) tiles(x, tile_row) = robust_mean(values[static_cast<std::size_t>(x)]);
  });
  fill(tiles);
  return {std::move(tiles), tile_px};
}

}  // namespace pagesweep
