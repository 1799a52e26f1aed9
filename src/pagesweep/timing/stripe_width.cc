// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/stripe_width.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pagesweep/base/parallel.h"
#include "pagesweep/data/time_map.h"
#include "pagesweep/timing/row_windows_internal.h"
#include "pagesweep/timing/width_tiles_internal.h"

namespace pagesweep {
namespace {

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

WidthTile width_tile(int width, int height, int column, int row) {
  const int left = column * width_tile_px, top = row * width_tile_px;
  return {left, top, std::min(width_tile_px, width - left), std::min(width_tile_px, height - top)};
}

int width_tiles(int pixels) { return (pixels + width_tile_px - 1) / width_tile_px; }

float robust_width(std::vector<MeasuredWidth>& values) {
  if (values.size() < 3) return not_a_number;
  std::ranges::sort(values, {}, &MeasuredWidth::log_width);
  double total = 0, passed = 0;
  for (const MeasuredWidth& value : values) total += value.weight;
  double median = 0;
  for (const MeasuredWidth& value : values) {
    median = value.log_width;
    if ((passed += value.weight) >= 0.5 * total) break;
  }
  const double spread = values[values.size() * 3 / 4].log_width - values[values.size() / 4].log_width;
  double weight = 0, sum = 0;
  for (const MeasuredWidth& value : values) {
    if (std::abs(value.log_width - median) > 1.5 * spread + 1e-4) continue;
    weight += value.weight;
    sum += value.weight * value.log_width;
  }
  const double widest = std::log(widest_stripe);
  return static_cast<float>(std::clamp(sum / weight, -widest, widest));
}

void note_width(double log_width, double sigma, double reduced_chi_square, std::vector<MeasuredWidth>& widths) {
  if (reduced_chi_square > 100) return;
  // What a model cannot do better than a percent does not count more for being brighter.
  const double variance = sigma * sigma + 1e-4;
  if (variance < 0.01) widths.push_back({log_width, 1 / variance});
}

void measure_width_alone(const PixelWindow& window, const StripeProfile& profile, const FrameNoise& noise,
                         std::vector<MeasuredWidth>& widths) {
  const BellFit fit = fit_bell(window.gray, window.first_frame, profile, noise, window.start,
                               {.unknowns = BellUnknowns::width, .late = window.late});
  if (fit.converged) note_width(std::log(fit.bell.width), fit.log_width_sigma(), fit.reduced_chi_square(), widths);
}

StripeWidths widths_of_tiles(Image<float> tiles) {
  fill(tiles);
  return {std::move(tiles), width_tile_px};
}

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

float StripeWidths::tile(int column, int row) const {
  if (log_width_.empty()) return 0;
  return log_width_(std::clamp(column, 0, log_width_.width() - 1), std::clamp(row, 0, log_width_.height() - 1));
}

std::pair<double, double> StripeWidths::range() const {
  if (log_width_.empty()) return {1, 1};
  const auto [low, high] = std::ranges::minmax(log_width_.pixels());
  return {std::exp(low), std::exp(high)};
}

StripeWidths measure_widths(const Frames& frames, const StripeProfile& profile, const SensorNoise& noise) {
  Image<float> tiles(width_tiles(frames.width()), width_tiles(frames.height()), not_a_number);
  const FrameNoise frame_noise(noise, frames.sequence().exposures);
  parallel_rows(tiles.height(), [&](int y) {
    RowWindows row(frames, profile, frame_noise);
    std::vector<MeasuredWidth> widths;
    for (int x = 0; x < tiles.width(); ++x) {
      const WidthTile tile = width_tile(frames.width(), frames.height(), x, y);
      widths.clear();
      int read = -1;
      for_width_pixels(tile, [&](int column, int line) {
        if (read != line) row.read(read = line, tile.left, tile.width);
        if (row.significance(column) >= least_significance_of_width)
          measure_width_alone(row.window(column, 1), profile, frame_noise, widths);
      });
      tiles(x, y) = robust_width(widths);
    }
  });
  return widths_of_tiles(std::move(tiles));
}

}  // namespace pagesweep
