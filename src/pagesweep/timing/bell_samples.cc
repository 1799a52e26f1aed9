// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/bell_samples_internal.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>

#include "pagesweep/timing/pixel_window_internal.h"
#include "pagesweep/timing/row_kernels_internal.h"

namespace pagesweep {

BellReader::BellReader(const StripeWindows& windows, const PlainBells& bells, double fwhm)
    : windows_(windows),
      bells_(bells),
      near_(static_cast<int>(std::ceil(0.5 * fwhm))),
      core_(static_cast<int>(std::ceil(1.5 * fwhm)) + 1),
      // What follows a pixel's samples is another's, or 0.
      light_(static_cast<std::size_t>(most_bells * windows.length() + most_bells)) {}

void BellReader::read(int x, int y, float log_width, int slot, BellSamples& samples) {
  windows_.is_8_bit() ? read(windows_.gray<std::uint8_t>(x, y), windows_.centre(x, y), log_width, slot, samples)
                      : read(windows_.gray<std::uint16_t>(x, y), windows_.centre(x, y), log_width, slot, samples);
}

template <class T>
void BellReader::read(const T* gray, int centre, float log_width, int slot, BellSamples& samples) {
  const Sequence& sequence = windows_.sequence();
  const auto black = static_cast<float>(sequence.black_level), saturation = static_cast<float>(sequence.saturation);
  const auto length = static_cast<std::size_t>(windows_.length());
  float* light = &light_[static_cast<std::size_t>(slot) * length];
  samples.centre = centre;
  samples.log_width = log_width;
  samples.table = &bells_.table(log_width);
  samples.light = light;
  const float most = take_off(gray, length, black, light);
  if (most >= saturation)
    for (std::size_t k = 0; k < length; ++k)
      if (static_cast<float>(gray[k]) >= saturation) light[k] = std::numeric_limits<float>::infinity();
  const int reach = bells_.reach(*samples.table);
  samples.is_whole = windows_.are_present(centre - reach, 2 * reach + 1);
  samples.kind = kind_of(samples, most >= saturation && is_clipped(samples));
  const auto content = BellSamples::content_of(samples.kind);
  samples.start = content == Content::clipped ? plateau(samples) : 0;
}

Content BellSamples::content_of(Kind kind) {
  if (kind == Kind::clipped || kind == Kind::clipped_uneven) return Content::clipped;
  return kind == Kind::core ? Content::whole : Content::partial;
}

bool BellReader::is_clipped(const BellSamples& samples) const {
  const int reach = bells_.reach(*samples.table), first = windows_.half() - reach;
  const float* present = windows_.present(samples.centre - reach);
  for (int k = 0; k <= 2 * reach; ++k)
    if (std::isinf(samples.light[first + k]) && present[k] > 0) return true;
  return false;
}

/// Middle of the plateau that is met near the expected one, relative to that.
int BellReader::plateau(const BellSamples& samples) const {
  const int half = windows_.half();
  const float* present = windows_.present(samples.centre - half);
  const auto is_clipped = [&](int k) { return std::isinf(samples.light[k]); };
  return plateau_middle(half, near_, windows_.length(), is_clipped, [&](int k) { return present[k] > 0; }) - half;
}

BellSamples::Kind BellReader::kind_of(const BellSamples& samples, bool is_clipped) const {
  using enum BellSamples::Kind;
  const int reach = bells_.reach(*samples.table), first = samples.centre - reach, count = 2 * reach + 1;
  if (windows_.are_even(first, count)) {
    if (is_clipped) return clipped;
    return windows_.are_present(samples.centre - core_, 2 * core_ + 1) ? core : partial;
  }
  const std::span late(windows_.late(first), static_cast<std::size_t>(count));
  const bool is_plain =
      std::ranges::all_of(late, [most = bells_.most_late()](float frames) { return std::abs(frames) <= most; });
  if (!is_plain) return too_uneven;
  return is_clipped ? clipped_uneven : uneven;
}

void BellReader::add_to(PlainBells& bells, const BellSamples& samples) const {
  const int first = samples.centre - windows_.half();
  bells.add(samples.centre, *samples.table, samples.log_width, samples.light, windows_.present(first),
            samples.kind == BellSamples::Kind::uneven || samples.kind == BellSamples::Kind::clipped_uneven
                ? windows_.late(first)
                : nullptr);
  bells.start_at(static_cast<float>(samples.start));
}

}  // namespace pagesweep
