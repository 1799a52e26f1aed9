// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/quality/paper_look.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "pagesweep/base/parallel.h"
#include "pagesweep/data/transfer_curve.h"

namespace pagesweep {
namespace {

constexpr double paper_quantile = 0.85;  // of a cell's light: paper between letters
constexpr double least_blank = 0.25;     // share of a cell that must be about as bright as that
constexpr double same_paper = 0.3;       // cells that differ more from the page's paper are pictures or other paper
constexpr double edge_mm = 2;            // from the page's edge that is left out
constexpr std::size_t least_cells = 12;

/// CIE 1976 lightness of a luminance relative to white.
double l_star(double y) { return y > 216.0 / 24389 ? 116 * std::cbrt(y) - 16 : y * 24389 / 27; }

float quantile(std::vector<float> values, double share) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * double(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Light of the paper in a cell; NaN if too little of it is paper.
float level_of(const Image<float>& light, int x0, int y0, int cell) {
  std::vector<float> values;
  for (int y = y0; y < y0 + cell; y += 2)
    for (int x = x0; x < x0 + cell; x += 2)
      if (std::isfinite(light(x, y))) values.push_back(light(x, y));
  if (2 * values.size() < static_cast<std::size_t>(cell * cell / 4)) return not_a_number;
  const float paper = quantile(values, paper_quantile);
  const auto blank = std::ranges::count_if(values, [&](float value) { return std::abs(value - paper) < 0.1f * paper; });
  return double(blank) > least_blank * double(values.size()) ? paper : not_a_number;
}

Image<float> map_levels(const Image<float>& light, double pixels_per_mm, double pitch_mm) {
  const int cell = std::max(4, static_cast<int>(std::lround(pitch_mm * pixels_per_mm)));
  const int margin = static_cast<int>(edge_mm * pixels_per_mm);
  const int columns = std::max(0, (light.width() - 2 * margin) / cell);
  const int rows = std::max(0, (light.height() - 2 * margin) / cell);
  Image<float> levels(columns, rows, not_a_number);
  parallel_rows(rows, [&](int j) {
    for (int i = 0; i < columns; ++i) levels(i, j) = level_of(light, margin + i * cell, margin + j * cell, cell);
  });
  return levels;
}

/// Standard deviation of L* in one square millimetre after a plane is taken away; NaN if it is not blank.
double noise_of(const Image<float>& light, int x0, int y0, int cell, float paper) {
  double n = 0, sum = 0, sum_x = 0, sum_y = 0, squares = 0, xx = 0;
  const double middle = 0.5 * (cell - 1);
  for (int y = 0; y < cell; ++y)
    for (int x = 0; x < cell; ++x) {
      const float value = light(x0 + x, y0 + y);
      if (!(std::abs(value - paper) < 0.15f * paper)) return std::nan("");
      const double l = l_star(value);
      n += 1;
      sum += l;
      squares += l * l;
      sum_x += l * (x - middle);
      sum_y += l * (y - middle);
      xx += (x - middle) * (x - middle);
    }
  const double left = squares - sum * sum / n - (sum_x * sum_x + sum_y * sum_y) / xx;
  return std::sqrt(std::max(0.0, left) / (n - 3));
}

double typical_noise(const Image<float>& light, double pixels_per_mm, const PaperLook& look) {
  const int cell = std::max(6, static_cast<int>(std::lround(pixels_per_mm)));
  std::vector<float> noises;
  for (int y = 0; y + cell <= light.height(); y += 2 * cell)
    for (int x = 0; x + cell <= light.width(); x += 2 * cell)
      if (const double noise = noise_of(light, x, y, cell, static_cast<float>(look.level)); std::isfinite(noise))
        noises.push_back(static_cast<float>(noise));
  return noises.size() < least_cells ? std::nan("") : double(quantile(noises, 0.5));
}

void count_clipped(const Page& page, PaperLook& look) {
  const Picture& picture = page.picture;
  std::size_t white = 0, black = 0, all = 0;
  std::visit(
      [&]<class T>(const Image<T>& samples) {
        for (int y = 0; y < picture.height(); ++y)
          for (int x = 0; x < picture.width(); ++x) {
            if (std::isnan(page.scan_map.u(x, y))) continue;
            const std::span<const T> pixel(&samples(x * picture.channels, y),
                                           static_cast<std::size_t>(picture.channels));
            ++all;
            white += std::ranges::any_of(pixel, [](T value) { return value == std::numeric_limits<T>::max(); });
            black += std::ranges::all_of(pixel, [](T value) { return value == 0; });
          }
      },
      picture.samples);
  look.clipped_white = all ? double(white) / double(all) : 0;
  look.clipped_black = all ? double(black) / double(all) : 0;
}

}  // namespace

PictureLight::PictureLight(const Picture& picture)
    : picture_(&picture), lights_(TransferCurve::of(picture).table(picture.bit_depth())) {}

Image<float> light_of_page(const Page& page) {
  const PictureLight picture(page.picture);
  Image<float> light(picture.width(), picture.height());
  parallel_rows(light.height(), [&](int y) {
    for (int x = 0; x < light.width(); ++x)
      light(x, y) = std::isnan(page.scan_map.u(x, y)) ? not_a_number : picture.at(x, y);
  });
  return light;
}

PaperLook look_at_paper(const Page& page, const Image<float>& light) {
  PaperLook look;
  look.levels = map_levels(light, page.picture.pixels_per_mm, look.pitch_mm);
  count_clipped(page, look);
  std::vector<float> known;
  for (const float level : look.levels.pixels())
    if (std::isfinite(level)) known.push_back(level);
  look.level = look.non_uniformity = look.noise_l_star = not_a_number;
  if (known.size() < least_cells) return look;
  look.level = quantile(known, 0.5);
  std::vector<float> paper;
  for (float& level : look.levels.pixels()) {
    if (!(std::abs(level - look.level) < same_paper * look.level)) level = not_a_number;
    if (std::isfinite(level)) paper.push_back(level);
  }
  if (paper.size() < least_cells) return look;
  look.non_uniformity = 1 - double(quantile(paper, 0.02)) / double(quantile(paper, 0.98));
  look.noise_l_star = typical_noise(light, page.picture.pixels_per_mm, look);
  return look;
}

}  // namespace pagesweep
