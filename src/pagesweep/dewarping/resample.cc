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

namespace pagesweep {
namespace {

double cubic(double x, double b, double c) {
  x = std::abs(x);
  if (x < 1) return ((12 - 9 * b - 6 * c) * x * x * x + (-18 + 12 * b + 6 * c) * x * x + 6 - 2 * b) / 6;
  if (x < 2) return ((-b - 6 * c) * x * x * x + (6 * b + 30 * c) * x * x + (-12 * b - 48 * c) * x + 8 * b + 24 * c) / 6;
  return 0;
}

double sinc(double x) { return x == 0 ? 1 : std::sin(std::numbers::pi * x) / (std::numbers::pi * x); }

double kernel_value(ResampleKernel kernel, double x) {
  switch (kernel) {
    case ResampleKernel::catmull_rom:
      return cubic(x, 0, 0.5);
    case ResampleKernel::mitchell:
      return cubic(x, 1.0 / 3, 1.0 / 3);
    case ResampleKernel::lanczos3:
      return std::abs(x) < 3 ? sinc(x) * sinc(x / 3) : 0;
  }
  return 0;
}

int radius_of(ResampleKernel kernel) { return kernel == ResampleKernel::lanczos3 ? 3 : 2; }

/// Taps of a kernel widened by `scale`: pixels first_tap() ... first_tap() + taps - 1, counted from the position's
/// floor.
int taps_of(ResampleKernel kernel, double scale) { return 2 * static_cast<int>(std::ceil(radius_of(kernel) * scale)); }
int first_tap(int taps) { return 1 - taps / 2; }

/// Weights of all taps for a position `fraction` beyond a pixel's centre; they sum to 1.
void compute_weights(ResampleKernel kernel, double scale, double fraction, std::span<float> weights) {
  const int first = first_tap(static_cast<int>(weights.size()));
  double sum = 0;
  for (std::size_t k = 0; k < weights.size(); ++k)
    sum += kernel_value(kernel, (first + static_cast<int>(k) - fraction) / scale);
  for (std::size_t k = 0; k < weights.size(); ++k)
    weights[k] = static_cast<float>(kernel_value(kernel, (first + static_cast<int>(k) - fraction) / scale) / sum);
}

/// The weights of one kernel width for all fractions of a pixel.
class WeightTable {
 public:
  WeightTable(ResampleKernel kernel, double scale)
      // A wide kernel changes little from one phase to the next: the table's size stays the same.
      : taps_(taps_of(kernel, scale)), phases_(std::max(64, static_cast<int>(1024 / scale))) {
    weights_.resize(static_cast<std::size_t>(taps_) * static_cast<std::size_t>(phases_ + 1));
    for (int phase = 0; phase <= phases_; ++phase)
      compute_weights(
          kernel, scale, double(phase) / phases_,
          std::span(weights_).subspan(static_cast<std::size_t>(phase * taps_), static_cast<std::size_t>(taps_)));
  }
  int taps() const { return taps_; }
  const float* weights(float fraction) const {
    return weights_.data() + static_cast<int>(fraction * static_cast<float>(phases_) + 0.5f) * taps_;
  }

 private:
  int taps_;
  int phases_;
  std::vector<float> weights_;
};

/// Kernel widths are told apart in steps of 1/32.
constexpr float steps_per_scale = 32;
constexpr float max_scale = 32;
int scale_bin(float scale) {
  return scale > 1 ? static_cast<int>((std::min(scale, max_scale) - 1) * steps_per_scale + 0.5f) : 0;
}
double scale_of_bin(int bin) { return 1 + bin / double(steps_per_scale); }

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

/// The part of the scan under one kernel.
struct Footprint {
  int x, y;  ///< first tap [px]
  int taps_u, taps_v;
  const float* weights_u;
  const float* weights_v;
};

/// Weighted sum over a footprint. `Taps` fixes the number of taps along u at compile time; 0: any.
/// \param columns  room for taps_u x Channels values
template <class T, int Channels, int Taps>
void sum_inside(const Image<T>& samples, const Footprint& at, float* columns, float* sums) {
  const int length = (Taps > 0 ? Taps : at.taps_u) * Channels;
  std::fill_n(columns, length, 0.0f);
  for (int j = 0; j < at.taps_v; ++j) {
    const T* row = &samples(at.x * Channels, at.y + j);
    const float weight = at.weights_v[j];
    for (int k = 0; k < length; ++k) columns[k] += weight * static_cast<float>(row[k]);
  }
  std::fill_n(sums, Channels, 0.0f);
  for (int k = 0; k < length / Channels; ++k)
    for (int c = 0; c < Channels; ++c) sums[c] += at.weights_u[k] * columns[k * Channels + c];
}

/// The same where the footprint reaches beyond the scan: its outermost pixels are repeated.
template <class T, int Channels>
void sum_at_border(const Image<T>& samples, const Footprint& at, float* sums) {
  std::fill_n(sums, Channels, 0.0f);
  for (int j = 0; j < at.taps_v; ++j)
    for (int k = 0; k < at.taps_u; ++k) {
      const int x = std::clamp(at.x + k, 0, samples.width() / Channels - 1);
      const int y = std::clamp(at.y + j, 0, samples.height() - 1);
      for (int c = 0; c < Channels; ++c)
        sums[c] += at.weights_v[j] * at.weights_u[k] * static_cast<float>(samples(x * Channels + c, y));
    }
}

template <class T, int Channels>
class Resampler {
 public:
  Resampler(const Image<T>& scan, const ScanMap& map, const ResampleOptions& options)
      : scan_(scan), map_(map), fill_(to_sample<T>(float(options.fill) * std::numeric_limits<T>::max())) {
    const auto [low, high] = range_of_bins();
    first_bin_ = low;
    for (int bin = low; bin <= high; ++bin) tables_.emplace_back(options.kernel, scale_of_bin(bin));
  }

  void fill_row(int y, std::span<T> out) const {
    const auto taps = static_cast<std::size_t>(tables_.empty() ? 0 : tables_.back().taps());
    std::vector<float> columns(taps * Channels);
    for (int x = 0; x < map_.width(); ++x) {
      T* pixel = &out[static_cast<std::size_t>(x) * Channels];
      if (is_hidden(x, y)) {
        std::fill_n(pixel, Channels, fill_);
        continue;
      }
      float sums[Channels];
      add_up(footprint(x, y), columns.data(), sums);
      for (int c = 0; c < Channels; ++c) pixel[c] = to_sample<T>(sums[c]);
    }
  }

 private:
  bool is_hidden(int x, int y) const {
    return is_outside(map_.u(x, y), map_.v(x, y), scan_.width() / Channels, scan_.height());
  }

  /// The kernel widths that occur, so that only their tables are made.
  std::pair<int, int> range_of_bins() const {
    const auto height = static_cast<std::size_t>(map_.height());
    std::vector<std::pair<int, int>> of_row(height, {std::numeric_limits<int>::max(), -1});
    parallel_rows(map_.height(), [&](int y) {
      auto& [low, high] = of_row[static_cast<std::size_t>(y)];
      for (int x = 0; x < map_.width(); ++x) {
        if (is_hidden(x, y)) continue;
        for (const Image<float>* position : {&map_.u, &map_.v}) {
          const int bin = scale_bin(scale_at(*position, x, y));
          low = std::min(low, bin);
          high = std::max(high, bin);
        }
      }
    });
    std::pair<int, int> range{std::numeric_limits<int>::max(), -1};
    for (const auto& [low, high] : of_row) range = {std::min(range.first, low), std::max(range.second, high)};
    return range;
  }

  const WeightTable& table(float scale) const {
    return tables_[static_cast<std::size_t>(scale_bin(scale) - first_bin_)];
  }

  Footprint footprint(int x, int y) const {
    const float u = std::floor(map_.u(x, y)), v = std::floor(map_.v(x, y));
    const WeightTable& table_u = table(scale_at(map_.u, x, y));
    const WeightTable& table_v = table(scale_at(map_.v, x, y));
    return {static_cast<int>(u) + first_tap(table_u.taps()),
            static_cast<int>(v) + first_tap(table_v.taps()),
            table_u.taps(),
            table_v.taps(),
            table_u.weights(map_.u(x, y) - u),
            table_v.weights(map_.v(x, y) - v)};
  }

  void add_up(const Footprint& at, float* columns, float* sums) const {
    const bool inside =
        at.x >= 0 && at.y >= 0 && (at.x + at.taps_u) * Channels <= scan_.width() && at.y + at.taps_v <= scan_.height();
    if (!inside)
      sum_at_border<T, Channels>(scan_, at, sums);
    else if (at.taps_u == 4)
      sum_inside<T, Channels, 4>(scan_, at, columns, sums);
    else if (at.taps_u == 6)
      sum_inside<T, Channels, 6>(scan_, at, columns, sums);
    else if (at.taps_u == 8)
      sum_inside<T, Channels, 8>(scan_, at, columns, sums);
    else
      sum_inside<T, Channels, 0>(scan_, at, columns, sums);
  }

  const Image<T>& scan_;
  const ScanMap& map_;
  T fill_;
  int first_bin_ = 0;
  std::vector<WeightTable> tables_;
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
  const auto run = [&]<class T>(const Image<T>& samples, auto channels) {
    auto& out = std::get<Image<T>>(page.samples);
    const Resampler<T, channels> resampler(samples, map, options);
    parallel_ranges(map.height(), 16, [&](int begin, int end) {
      for (int y = begin; y < end; ++y) resampler.fill_row(y, out.row(y));
    });
  };
  std::visit(
      [&](const auto& samples) {
        scan.channels == 1 ? run(samples, std::integral_constant<int, 1>{})
                           : run(samples, std::integral_constant<int, 3>{});
      },
      scan.samples);
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
                  : plain_sample(samples, scan.channels, c, u, v, std::clamp(scale_at(map.u, x, y), 1.0f, max_scale),
                                 std::clamp(scale_at(map.v, x, y), 1.0f, max_scale), options.kernel);
        }
  };
  std::visit(run, scan.samples);
  return page;
}

}  // namespace pagesweep
