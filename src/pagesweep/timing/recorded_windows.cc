// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/recorded_windows_internal.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pagesweep/data/time_map.h"

namespace pagesweep {
namespace {

/// Calls body(gray) with the pixel's samples, of whichever depth.
template <class Body>
auto with_gray(const StripeWindows& windows, int x, int y, const Body& body) {
  return windows.is_8_bit() ? body(windows.gray<std::uint8_t>(x, y)) : body(windows.gray<std::uint16_t>(x, y));
}

}  // namespace

RecordedWindows::RecordedWindows(const StripeWindows& windows, const StripeProfile& profile, const FrameNoise& noise)
    : windows_(windows), profile_(profile), noise_(noise), reach_(reach_around(profile)) {}

int RecordedWindows::frame(int x) const {
  const int centre = windows_.centre(x, y_), half = windows_.half(), length = windows_.length();
  const int near = static_cast<int>(std::ceil(0.5 * profile_.full_width_half_maximum()));
  const float* present = windows_.present(centre - half);
  return with_gray(windows_, x, y_, [&](const auto* gray) {
    const auto is_clipped = [&](int k) { return gray[k] >= windows_.sequence().saturation; };
    return centre - half + plateau_middle(half, near, length, is_clipped, [&](int k) { return present[k] > 0; });
  });
}

PixelWindow RecordedWindows::window_at(int x, double width, int centre) {
  const Sequence& sequence = windows_.sequence();
  const int reach = static_cast<int>(std::ceil(reach_ * width));
  const int first = windows_.centre(x, y_) - windows_.half();
  const int begin = std::max({0, first, centre - reach});
  const int end = std::min({sequence.count, first + windows_.length(), centre + reach + 1});
  gray_.clear();
  late_.clear();
  const bool is_even = windows_.are_even(begin, end - begin);
  with_gray(windows_, x, y_, [&](const auto* gray) {
    for (int i = begin; i < end; ++i) {
      const double value = gray[i - first];
      const bool is_clipped = value >= sequence.saturation;
      gray_.push_back(*windows_.present(i) == 0 ? not_a_number
                      : is_clipped              ? std::numeric_limits<float>::infinity()
                                                : static_cast<float>(value - sequence.black_level));
      if (!is_even) late_.push_back(*windows_.late(i));
    }
  });
  return make_window(gray_, begin, centre, width, profile_, noise_, late_);
}

}  // namespace pagesweep
