// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/stripe_windows_internal.h"

#include "pagesweep/timing/bell_batch_internal.h"

namespace pagesweep {

StripeWindows::StripeWindows(const Sequence& sequence, int half)
    : sequence_(sequence),
      half_(half),
      // Whole vectors are read, and a window may lie at the very ends.
      margin_(2 * half + 1 + most_bells),
      centre_(sequence.width, sequence.height, none),
      significance_(sequence.width, sequence.height) {
  if (sequence.is_8_bit())
    gray_ = Image<std::uint8_t>(sequence.width * length(), sequence.height);
  else
    gray_ = Image<std::uint16_t>(sequence.width * length(), sequence.height);
  set_present({});
}

void StripeWindows::set_present(std::span<const std::uint8_t> present) {
  present_.assign(static_cast<std::size_t>(sequence_.count + 2 * margin_), 0.0F);
  for (std::size_t i = 0; i < present.size(); ++i) present_[i + static_cast<std::size_t>(margin_)] = present[i];
  absent_before_.assign(1, 0);
  for (const float here : present_) absent_before_.push_back(absent_before_.back() + (here == 0 ? 1 : 0));
}

}  // namespace pagesweep
