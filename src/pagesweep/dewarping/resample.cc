// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/resample.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

#include "pagesweep/base/parallel.h"
#include "pagesweep/dewarping/resample_run_internal.h"

namespace pagesweep {
namespace {

/// Change of a map from one pixel to the next. Of the two sides the smaller one counts: where the map jumps, across a
/// hidden strip, the other side is the neighbour on the paper.
float slope(float before, float at, float after) {
  const float back = std::abs(at - before), ahead = std::abs(after - at);
  return !(ahead < back) && !std::isnan(back) ? back : ahead;
}

/// By how much the map minifies along one axis of the scan at page pixel (x, y): scan pixels a page pixel.
float scale_at(const Image<float>& position, int x, int y) {
  const auto at = [&](int i, int j) { return position.contains(i, j) ? position(i, j) : not_a_number; };
  const float across = slope(at(x - 1, y), position(x, y), at(x + 1, y));
  const float down = slope(at(x, y - 1), position(x, y), at(x, y + 1));
  // A pixel without seen neighbours on one axis (NaN) is judged by the other one.
  return std::sqrt((std::isnan(across) ? 0 : across * across) + (std::isnan(down) ? 0 : down * down));
}

/// Whether the scan shows nothing at a position; NaN is nowhere.
bool is_outside(float u, float v, int width, int height) {
  return !(u >= -0.5f && v >= -0.5f && u <= float(width) - 0.5f && v <= float(height) - 0.5f);
}

template <class T>
T to_sample(float value) {
  constexpr float white = std::numeric_limits<T>::max();
  return static_cast<T>(std::clamp(value, 0.0f, white) + 0.5f);
}

/// Weighted sum where the kernel reaches beyond the scan: its outermost pixels are repeated.
template <class T>
void sum_at_border(const ResampleRun<T, float>& run, int width, int height, int k) {
  const int taps_u = run.across->taps(), taps_v = run.down->taps();
  const float* weights_u = run.across->down()[run.u[k] & (phases_per_px - 1)];
  const float* weights_v = run.down->down()[run.v[k] & (phases_per_px - 1)];
  float sums[3] = {};
  for (int j = 0; j < taps_v; ++j)
    for (int i = 0; i < taps_u; ++i) {
      const int x = std::clamp((run.u[k] >> phase_bits) + first_tap(taps_u) + i, 0, width - 1);
      const int y = std::clamp((run.v[k] >> phase_bits) + first_tap(taps_v) + j, 0, height - 1);
      const T* pixel = run.scan + y * run.stride + static_cast<std::ptrdiff_t>(x) * run.channels;
      for (int c = 0; c < run.channels; ++c) sums[c] += weights_v[j] * weights_u[i] * static_cast<float>(pixel[c]);
    }
  for (int c = 0; c < run.channels; ++c) run.out[k * run.channels + c] = to_sample<T>(sums[c]);
}

template <class T>
class Resampler {
 public:
  Resampler(const Image<T>& scan, int channels, const ScanMap& map, const ResampleOptions& options)
      : scan_(scan),
        channels_(channels),
        map_(map),
        options_(options),
        fixed_(options.kernel, fixed_point_layout(channels)),
        float_(options.kernel, float_layout(channels)) {}

  /// Pixels [x, x + count) of a page row; `out` is the row.
  void fill(int x, int y, int count, T* out) {
    Lookups lookups;
    look_up(map_, x, y, count, scan_.width() / channels_, scan_.height(), lookups);
    for (int begin = 0, end = 0; begin < count; begin = end) {
      const int width_u = lookups.width_u[begin], width_v = lookups.width_v[begin];
      if (lookups.alike) end = count;
      while (end < count && lookups.width_u[end] == width_u && lookups.width_v[end] == width_v) ++end;
      T* pixels = out + static_cast<std::ptrdiff_t>(x + begin) * channels_;
      if (width_u == Lookups::hidden)
        std::fill_n(pixels, (end - begin) * channels_,
                    to_sample<T>(float(options_.fill) * std::numeric_limits<T>::max()));
      else
        sum(lookups, begin, end, pixels);
    }
  }

 private:
  /// Fixed point is exact enough for 8 bit and so many taps: rounding errors of 1/128 gray value a tap along either
  /// axis stay below half a gray value, so that a constant picture stays constant.
  static constexpr int most_taps_in_fixed_point = 16;

  template <class Weight>
  ResampleRun<T, Weight> run_of(const Lookups& lookups, int begin, int count, KernelTables<Weight>& tables, T* out) {
    return {scan_.data(),
            scan_.width(),
            channels_,
            &tables[lookups.width_u[begin]],
            &tables[lookups.width_v[begin]],
            lookups.u + begin,
            lookups.v + begin,
            count,
            out};
  }

  /// Pixels of the same kernel widths, stretch by stretch within the scan or at its border.
  void sum(const Lookups& lookups, int begin, int end, T* out) {
    const int width = scan_.width() / channels_;
    const int taps_u = taps_of(options_.kernel, width_of(lookups.width_u[begin]));
    const int taps_v = taps_of(options_.kernel, width_of(lookups.width_v[begin]));
    constexpr int overread = 32;  // the most lanes that a vector has: the same on all processors
    const auto is_place_inside = [&](std::int32_t position_u, std::int32_t position_v) {
      const int u = (position_u >> phase_bits) + first_tap(taps_u);
      const int v = (position_v >> phase_bits) + first_tap(taps_v);
      // What is read beyond the last tap is the next row, or the one after, but must not lie beyond the picture.
      const std::int64_t last = std::int64_t{v + taps_v - 1} * width + u + taps_u;
      return u >= 0 && v >= 0 && u + taps_u <= width && v + taps_v <= scan_.height() &&
             last + overread <= std::int64_t{width} * scan_.height();
    };
    const auto is_inside = [&](int k) { return is_place_inside(lookups.u[k], lookups.v[k]); };
    const bool all_inside =
        is_place_inside(lookups.low_u, lookups.low_v) && is_place_inside(lookups.high_u, lookups.high_v);
    for (int k = begin, next = begin; k < end; k = next) {
      const bool inside = all_inside || is_inside(k);
      if (all_inside) next = end;
      while (next < end && is_inside(next) == inside) ++next;
      T* pixels = out + static_cast<std::ptrdiff_t>(k - begin) * channels_;
      if (!inside) {
        const auto run = run_of(lookups, k, next - k, float_, pixels);
        for (int i = 0; i < run.count; ++i) sum_at_border(run, width, scan_.height(), i);
      } else if (std::is_same_v<T, std::uint8_t> && std::max(taps_u, taps_v) <= most_taps_in_fixed_point) {
        if constexpr (std::is_same_v<T, std::uint8_t>) resample_run(run_of(lookups, k, next - k, fixed_, pixels));
      } else {
        resample_run(run_of(lookups, k, next - k, float_, pixels));
      }
    }
  }

  const Image<T>& scan_;
  int channels_;
  const ScanMap& map_;
  const ResampleOptions& options_;
  KernelTables<std::int16_t> fixed_;
  KernelTables<float> float_;
};

/// An empty page with what the scan's file says about its picture.
Picture make_page_picture(const Picture& scan, const ScanMap& map, double pixels_per_mm) {
  if (scan.width() == 0 || scan.height() == 0) throw std::invalid_argument("resample: the scan is empty");
  Picture page = make_picture(map.width(), map.height(), scan.channels, scan.bit_depth());
  page.pixels_per_mm = pixels_per_mm;
  page.icc_profile = scan.icc_profile;
  page.metadata = scan.metadata;
  return page;
}

template <class T>
T plain_sample(const Image<T>& samples, int channels, int channel, double u, double v, double scale_u, double scale_v,
               ResampleKernel kernel) {
  std::vector<float> weights_u(static_cast<std::size_t>(taps_of(kernel, scale_u)));
  std::vector<float> weights_v(static_cast<std::size_t>(taps_of(kernel, scale_v)));
  compute_weights(kernel, scale_u, u - std::floor(u), weights_u);
  compute_weights(kernel, scale_v, v - std::floor(v), weights_v);
  double sum = 0;
  for (std::size_t j = 0; j < weights_v.size(); ++j)
    for (std::size_t k = 0; k < weights_u.size(); ++k) {
      const int x =
          static_cast<int>(std::floor(u)) + first_tap(static_cast<int>(weights_u.size())) + static_cast<int>(k);
      const int y =
          static_cast<int>(std::floor(v)) + first_tap(static_cast<int>(weights_v.size())) + static_cast<int>(j);
      const int inside_x = std::clamp(x, 0, samples.width() / channels - 1);
      const int inside_y = std::clamp(y, 0, samples.height() - 1);
      sum += double(weights_u[k]) * double(weights_v[j]) * samples(inside_x * channels + channel, inside_y);
    }
  return to_sample<T>(static_cast<float>(sum));
}

}  // namespace

Picture resample(const Picture& scan, const ScanMap& map, double pixels_per_mm, const ResampleOptions& options) {
  Picture page = make_page_picture(scan, map, pixels_per_mm);
  const auto run = [&]<class T>(const Image<T>& samples) {
    auto& out = std::get<Image<T>>(page.samples);
    Resampler<T> resampler(samples, scan.channels, map, options);
    // Tiles: the part of the scan that one looks at fits into the innermost cache.
    parallel_ranges(map.height(), 16, [&](int begin, int end) {
      for (int x = 0; x < map.width(); x += Lookups::most)
        for (int y = begin; y < end; ++y)
          resampler.fill(x, y, std::min(Lookups::most, map.width() - x), out.row(y).data());
    });
  };
  std::visit(run, scan.samples);
  return page;
}

Picture resample_plainly(const Picture& scan, const ScanMap& map, double pixels_per_mm,
                         const ResampleOptions& options) {
  Picture page = make_page_picture(scan, map, pixels_per_mm);
  const auto run = [&]<class T>(const Image<T>& samples) {
    auto& out = std::get<Image<T>>(page.samples);
    for (int y = 0; y < map.height(); ++y)
      for (int x = 0; x < map.width(); ++x)
        for (int c = 0; c < scan.channels; ++c) {
          const float u = map.u(x, y), v = map.v(x, y);
          out(x * scan.channels + c, y) =
              is_outside(u, v, scan.width(), scan.height())
                  ? to_sample<T>(float(options.fill) * std::numeric_limits<T>::max())
                  : plain_sample(samples, scan.channels, c, u, v,
                                 std::clamp(scale_at(map.u, x, y), 1.0f, largest_width),
                                 std::clamp(scale_at(map.v, x, y), 1.0f, largest_width), options.kernel);
        }
  };
  std::visit(run, scan.samples);
  return page;
}

}  // namespace pagesweep
