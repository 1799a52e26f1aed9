// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/report/colour_ramp.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace pagesweep {
namespace {

/// CIE 1976 L*a*b* under D65, as lightness, chroma and hue.
struct Lch {
  double lightness = 0;  ///< 0 to 100
  double chroma = 0;
  double hue_deg = 0;
};

double from_linear(double light) {
  return light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
}

/// Nothing if the colour is outside sRGB.
std::optional<Rgb> to_rgb(const Lch& lch) {
  constexpr double degree = M_PI / 180;
  const double fy = (lch.lightness + 16) / 116;
  const double fx = fy + lch.chroma * std::cos(lch.hue_deg * degree) / 500;
  const double fz = fy - lch.chroma * std::sin(lch.hue_deg * degree) / 200;
  const auto unroot = [](double f) { return f > 6.0 / 29 ? f * f * f : 3 * (6.0 / 29) * (6.0 / 29) * (f - 4.0 / 29); };
  const double x = 0.95047 * unroot(fx), y = unroot(fy), z = 1.08883 * unroot(fz);
  const std::array<double, 3> light{3.2406 * x - 1.5372 * y - 0.4986 * z, -0.9689 * x + 1.8758 * y + 0.0415 * z,
                                    0.0557 * x - 0.2040 * y + 1.0570 * z};
  std::array<std::uint8_t, 3> rgb{};
  for (std::size_t i = 0; i < 3; ++i) {
    if (light[i] < -1e-3 || light[i] > 1 + 1e-3) return std::nullopt;
    rgb[i] = static_cast<std::uint8_t>(std::lround(255 * from_linear(std::clamp(light[i], 0.0, 1.0))));
  }
  return Rgb{rgb[0], rgb[1], rgb[2]};
}

/// The colour of that lightness and hue, as strong as asked for or as the screen can.
Rgb strongest(Lch lch) {
  const double wanted = lch.chroma;
  double low = 0, high = wanted;
  if (const auto rgb = to_rgb(lch)) return *rgb;
  for (int i = 0; i < 12; ++i) {
    lch.chroma = 0.5 * (low + high);
    (to_rgb(lch) ? low : high) = lch.chroma;
  }
  lch.chroma = low;
  return to_rgb(lch).value_or(no_value_colour);
}

Rgb compute(Ramp ramp, double share) {
  if (ramp == Ramp::gray) {
    const auto gray = static_cast<std::uint8_t>(std::lround(255 * share));
    return {gray, gray, gray};
  }
  if (ramp == Ramp::sequential) return strongest({16 + 76 * share, 44 + 14 * share, 300 - 205 * share});
  const double side = 2 * share - 1;
  return strongest({95 - 55 * std::abs(side), 72 * std::pow(std::abs(side), 0.8), side < 0 ? 262.0 : 34.0});
}

constexpr std::size_t table_size = 256;
using Table = std::array<Rgb, table_size>;

Table make_table(Ramp ramp) {
  Table table;
  for (std::size_t i = 0; i < table_size; ++i) table[i] = compute(ramp, static_cast<double>(i) / (table_size - 1));
  return table;
}

}  // namespace

Rgb colour_of(Ramp ramp, double share) {
  static const std::array<Table, 3> tables{make_table(Ramp::sequential), make_table(Ramp::diverging),
                                           make_table(Ramp::gray)};
  if (std::isnan(share)) return no_value_colour;
  const double clamped = std::clamp(share, 0.0, 1.0);
  return tables[static_cast<std::size_t>(ramp)][static_cast<std::size_t>(std::lround(clamped * (table_size - 1)))];
}

Rgb colour_of(PixelStatus status) {
  switch (status) {
    case PixelStatus::ok:
      return {196, 224, 202};
    case PixelStatus::not_computed:
      return {236, 236, 238};
    case PixelStatus::too_dark:
      return {64, 66, 74};
    case PixelStatus::truncated:
      return {123, 94, 167};
    case PixelStatus::saturated:
      return {245, 196, 66};
    case PixelStatus::bad_fit:
      return {214, 90, 60};
    case PixelStatus::outside_view:
      return {160, 166, 178};
    case PixelStatus::no_match:
      return {46, 116, 181};
    case PixelStatus::ambiguous:
      return {122, 184, 224};
    case PixelStatus::inconsistent:
      return {20, 150, 150};
    case PixelStatus::outside_depth:
      return {146, 108, 72};
    case PixelStatus::rays_miss:
      return {198, 68, 140};
    case PixelStatus::off_surface:
      return {150, 24, 40};
    case PixelStatus::hidden:
      return {112, 128, 92};
    case PixelStatus::covered:
      return {232, 146, 124};
  }
  return no_value_colour;
}

std::string css_colour(Rgb colour) { return fmt::format("#{:02x}{:02x}{:02x}", colour.r, colour.g, colour.b); }

std::string css_gradient(Ramp ramp) {
  std::string stops;
  constexpr int count = 16;
  for (int i = 0; i <= count; ++i) stops += ", " + css_colour(colour_of(ramp, static_cast<double>(i) / count));
  return "linear-gradient(to right" + stops + ")";
}

}  // namespace pagesweep
