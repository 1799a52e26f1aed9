// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/stripe_windows_internal.h"

#include <algorithm>
#include <cstddef>

#include "pagesweep/timing/bell_batch_internal.h"

namespace pagesweep {

StripeWindows::StripeWindows(const Sequence& sequence, int half)
    : sequence_(sequence),
      half_(half),
      // Whole vectors are read, and a window may lie at the very ends.
      margin_(2 * half + 1 + most_bells),
      centre_(sequence.width, sequence.height, none),
      significance_(sequence.width, sequence.height) {
  const std::size_t samples = first_sample(0, sequence.height);
  // Whoever writes a window first gets the memory for it, on all threads.
  gray_ = std::make_unique_for_overwrite<std::byte[]>(samples * (sequence.is_8_bit() ? 1 : 2));
  set_frames({}, {});
}

void StripeWindows::set_frames(std::span<const std::uint8_t> present, std::span<const float> late) {
  const auto margin = static_cast<std::size_t>(margin_), size = present.size() + 2 * margin;
  present_.assign(size, 0.0F);
  late_.assign(size, 0.0F);
  std::ranges::copy(present, present_.begin() + margin_);
  std::ranges::copy(late, late_.begin() + margin_);
  absent_before_.assign(1, 0);
  late_before_.assign(1, 0);
  for (std::size_t i = 0; i < size; ++i) {
    absent_before_.push_back(absent_before_.back() + (present_[i] == 0 ? 1 : 0));
    late_before_.push_back(late_before_.back() + (late_[i] != 0 ? 1 : 0));
  }
}

}  // namespace pagesweep
