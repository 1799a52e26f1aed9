// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>
#include <type_traits>
#include <vector>

#include "pagesweep/dewarping/kernel_table_internal.h"

namespace pagesweep {
namespace {

constexpr int most_shared_bits = 3;  // 64 phases a pixel remain

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

void store(std::span<const float> weights, float* out) { std::ranges::copy(weights, out); }

/// Rounded such that they still sum to 1: a constant picture stays what it is. The largest one takes up the difference.
void store(std::span<const float> weights, std::int16_t* out) {
  constexpr int one = 32768;
  int sum = 0;
  std::ranges::transform(weights, out, [&](float weight) {
    const int rounded = std::min(one - 1, static_cast<int>(std::lround(weight * one)));
    sum += rounded;
    return static_cast<std::int16_t>(rounded);
  });
  std::int16_t& largest = *std::max_element(out, out + weights.size());
  largest = static_cast<std::int16_t>(std::min(one - 1, largest + one - sum));
}

}  // namespace

int taps_of(ResampleKernel kernel, double width) { return 2 * static_cast<int>(std::ceil(radius_of(kernel) * width)); }

void compute_weights(ResampleKernel kernel, double width, double fraction, std::span<float> weights) {
  const int first = first_tap(static_cast<int>(weights.size()));
  double sum = 0;
  for (std::size_t k = 0; k < weights.size(); ++k)
    sum += kernel_value(kernel, (first + static_cast<int>(k) - fraction) / width);
  for (std::size_t k = 0; k < weights.size(); ++k)
    weights[k] = static_cast<float>(kernel_value(kernel, (first + static_cast<int>(k) - fraction) / width) / sum);
}

template <class Weight>
KernelTable<Weight>::KernelTable(ResampleKernel kernel, double width, const LaneLayout& layout)
    : taps_(taps_of(kernel, width)),
      chunks_((taps_ * layout.channels + layout.used() - 1) / layout.used()),
      shift_(std::min(most_shared_bits, static_cast<int>(std::log2(width)))),
      down_(taps_, phases_per_px >> shift_),
      down_spread_(std::is_same_v<Weight, std::int16_t> && layout.channels == 1 ? taps_ * layout.lanes : 0,
                   phases_per_px >> shift_),
      across_(chunks_ * layout.lanes, phases_per_px >> shift_) {
  std::vector<float> weights(static_cast<std::size_t>(taps_));
  for (int row = 0; row < down_.height(); ++row) {
    const double middle = (row << shift_) + 0.5 * ((1 << shift_) - 1);  // of the phases that share the row
    compute_weights(kernel, width, middle / phases_per_px, weights);
    store(weights, down_.row(row).data());
    for (int k = 0; k < taps_ * layout.channels; ++k)
      across_(k / layout.used() * layout.lanes + k % layout.used(), row) = down_(k / layout.channels, row);
    for (int k = 0; k < down_spread_.width(); ++k) down_spread_(k, row) = down_(k / layout.lanes, row);
  }
}

template <class Weight>
const KernelTable<Weight>& KernelTables<Weight>::operator[](int width) {
  const auto k = static_cast<std::size_t>(width);
  std::call_once(made_[k],
                 [&] { tables_[k] = std::make_unique<KernelTable<Weight>>(kernel_, width_of(width), layout_); });
  return *tables_[k];
}

template class KernelTable<float>;
template class KernelTable<std::int16_t>;
template class KernelTables<float>;
template class KernelTables<std::int16_t>;

}  // namespace pagesweep
