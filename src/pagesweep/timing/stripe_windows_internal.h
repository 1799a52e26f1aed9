// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/data/frames.h"

namespace pagesweep {

/// What is kept of a camera's frames: for each pixel the gray values around the moment at which the stripe passed it.
class StripeWindows {
 public:
  static constexpr std::int32_t none = -1;

  StripeWindows() = default;
  /// \param half  [frames] to both sides of the middle
  StripeWindows(const Sequence& sequence, int half);

  const Sequence& sequence() const { return sequence_; }
  int half() const { return half_; }
  int length() const { return 2 * half_ + 1; }  ///< [samples] of a pixel

  /// [frames] of the window's middle; `none` where no stripe passed.
  std::int32_t centre(int x, int y) const { return centre_(x, y); }
  /// How many standard deviations the stripe search's response lies above what noise alone would give.
  float significance(int x, int y) const { return significance_(x, y); }
  /// The pixel's gray values as the sensor has them, length() of them, the first of frame centre() - half(). Where
  /// there was no frame stands a neighbouring one's.
  template <class T>
  const T* gray(int x, int y) const {
    return reinterpret_cast<const T*>(gray_.get()) + first_sample(x, y);
  }
  bool is_8_bit() const { return sequence_.is_8_bit(); }

  /// For frame `first` and those after it 1, or 0 where there is none. \pre first >= -half()
  const float* present(int first) const { return &present_[static_cast<std::size_t>(first + margin_)]; }
  /// Whether all of `count` frames are there.
  bool are_present(int first, int count) const {
    const auto begin = static_cast<std::size_t>(first + margin_);
    return absent_before_[begin] == absent_before_[begin + static_cast<std::size_t>(count)];
  }

  /// For frame `first` and those after it, how much later than that they were exposed [frames]. \pre first >= -half()
  const float* late(int first) const { return &late_[static_cast<std::size_t>(first + margin_)]; }
  /// Whether none of `count` frames was late.
  bool are_even(int first, int count) const {
    if (count <= 0) return true;
    const auto begin = static_cast<std::size_t>(first + margin_);
    return late_before_[begin] == late_before_[begin + static_cast<std::size_t>(count)];
  }

  /// Tells which frames there are, and when they were exposed.
  void set_frames(std::span<const std::uint8_t> present, std::span<const float> late);
  /// No frame from `count` on will come.
  void end_at(int count) { sequence_.count = count; }
  void set(int x, int y, std::int32_t centre, float significance) {
    centre_(x, y) = centre;
    significance_(x, y) = significance;
  }
  template <class T>
  T* gray(int x, int y) {
    return reinterpret_cast<T*>(gray_.get()) + first_sample(x, y);
  }

 private:
  std::size_t first_sample(int x, int y) const {
    const auto pixel =
        static_cast<std::size_t>(y) * static_cast<std::size_t>(sequence_.width) + static_cast<std::size_t>(x);
    return pixel * static_cast<std::size_t>(length());
  }

  Sequence sequence_;
  int half_ = 0;
  int margin_ = 0;                     ///< [frames] before the first and after the last
  std::unique_ptr<std::byte[]> gray_;  ///< of either depth; nothing where no stripe passed, not even memory
  Image<std::int32_t> centre_;
  Image<float> significance_;
  std::vector<float> present_;
  std::vector<int> absent_before_;  ///< how many of present_ before an entry are 0
  std::vector<float> late_;
  std::vector<int> late_before_;  ///< how many of late_ before an entry are not 0
};

}  // namespace pagesweep
