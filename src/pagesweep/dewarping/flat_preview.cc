// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "pagesweep/base/parallel.h"
#include "pagesweep/dewarping/flat_preview_internal.h"
#include "pagesweep/dewarping/page_frame.h"
#include "pagesweep/dewarping/scan_map.h"

namespace pagesweep {
namespace {

/// Whether the surface node nearest to the spot was measured; spots beyond the outermost half cell belong to none.
bool is_measured(const PageSurface& surface, double s_mm, double t_mm) {
  const long i = std::lround((s_mm - surface.s0_mm) / surface.spacing_mm);
  const long j = std::lround((t_mm - surface.t0_mm) / surface.spacing_mm);
  if (i < 0 || j < 0 || i >= surface.status.width() || j >= surface.status.height()) return false;
  return surface.status(static_cast<int>(i), static_cast<int>(j)) == PixelStatus::ok;
}

/// out(x, y) = choose over in(x - radius ... x + radius, y), as rows; the picture's border is repeated.
template <class Choose>
Image<float> filter_rows(const Image<float>& in, int radius, const Choose& choose) {
  Image<float> out(in.width(), in.height());
  const auto width = static_cast<std::size_t>(in.width());
  const auto reach = static_cast<std::size_t>(radius);
  parallel_ranges(in.height(), 16, [&](int begin, int end) {
    std::vector<float> padded(width + 2 * reach);
    for (int y = begin; y < end; ++y) {
      const std::span<const float> row = in.row(y);
      std::fill_n(padded.begin(), reach, row.front());
      std::ranges::copy(row, padded.begin() + radius);
      std::fill_n(padded.end() - radius, reach, row.back());
      const std::span<float> chosen = out.row(y);
      std::copy_n(padded.begin(), width, chosen.begin());
      for (std::size_t k = 1; k <= 2 * reach; ++k)
        for (std::size_t x = 0; x < width; ++x) chosen[x] = choose(chosen[x], padded[x + k]);
    }
  });
  return out;
}

Image<float> transposed(const Image<float>& in) {
  Image<float> out(in.height(), in.width());
  for (int y = 0; y < in.height(); ++y)
    for (int x = 0; x < in.width(); ++x) out(y, x) = in(x, y);
  return out;
}

template <class Choose>
Image<float> filter_squares(const Image<float>& in, int radius, const Choose& choose) {
  return transposed(filter_rows(transposed(filter_rows(in, radius, choose)), radius, choose));
}

}  // namespace

double brightness_at(const Picture& scan, const Eigen::Vector2d& pixel) {
  const double u = pixel.x(), v = pixel.y();
  const auto look_up = [&]<class T>(const Image<T>& samples) {
    const int channels = scan.channels, width = samples.width() / channels, height = samples.height();
    if (!(u >= 0 && v >= 0 && u <= width - 1.0 && v <= height - 1.0)) return std::numeric_limits<double>::quiet_NaN();
    const int x = std::min(static_cast<int>(u), std::max(0, width - 2));
    const int y = std::min(static_cast<int>(v), std::max(0, height - 2));
    const auto pixel_sum = [&](int i, int j) {
      const T* sample = &samples(std::min(i, width - 1) * channels, j);
      double sum = 0;
      for (int c = 0; c < channels; ++c) sum += sample[c];
      return sum;
    };
    const int below = std::min(y + 1, height - 1);
    const double upper = pixel_sum(x, y) + (u - x) * (pixel_sum(x + 1, y) - pixel_sum(x, y));
    const double lower = pixel_sum(x, below) + (u - x) * (pixel_sum(x + 1, below) - pixel_sum(x, below));
    return (upper + (v - y) * (lower - upper)) / (channels * double(std::numeric_limits<T>::max()));
  };
  return std::visit(look_up, scan.samples);
}

FlatPreview make_flat_preview(const PaperView& view, const Picture& scan, double reach_mm) {
  const PageSurface& surface = view.surface();
  FlatPreview preview;
  double left = surface.s_of(0) - (surface.gutter_at_left ? 0 : reach_mm);
  const double right = surface.s_of(surface.columns() - 1) + (surface.gutter_at_right ? 0 : reach_mm);
  // Whole cells, up to the gutter exactly; what the last one is too wide goes to the other side.
  if (surface.gutter_at_right) left = right - std::ceil((right - left) / preview.pitch_mm) * preview.pitch_mm;
  const double top = surface.t_of(0) - reach_mm, bottom = surface.t_of(surface.rows() - 1) + reach_mm;
  const double half = 0.5 * preview.pitch_mm;
  preview.s0_mm = left + half;
  preview.t0_mm = top + half;
  const PageFrame frame{{left, top}, 0, right - left, bottom - top};
  constexpr double tolerance_px = 0.5;
  const ScanMap map = build_scan_map(view, Occlusion(), frame, 1 / preview.pitch_mm, tolerance_px);
  preview.brightness = Image<float>(map.width(), map.height(), not_a_number);
  preview.measured = Image<char>(map.width(), map.height(), false);
  parallel_rows(map.height(), [&](int y) {
    for (int x = 0; x < map.width(); ++x) {
      const double brightness = brightness_at(scan, {map.u(x, y), map.v(x, y)});
      preview.brightness(x, y) = static_cast<float>(brightness);
      preview.measured(x, y) = !std::isnan(brightness) && is_measured(surface, preview.s_of(x), preview.t_of(y));
    }
  });
  return preview;
}

Image<float> close_dark_spots(const Image<float>& brightness, int radius) {
  Image<float> known = brightness;
  for (float& value : known.pixels())
    if (std::isnan(value)) value = 0;
  const auto larger = [](float a, float b) { return a < b ? b : a; };
  const auto smaller = [](float a, float b) { return b < a ? b : a; };
  return filter_squares(filter_squares(known, radius, larger), radius, smaller);
}

}  // namespace pagesweep
