// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "pagesweep/timing/stripe_profile.h"

namespace pagesweep {

/// Bins of equal length in time for samples of many pixels, brought to the profile's time and height.
class ProfileBins {
 public:
  using Point = StripeProfile::Point;

  /// [frames] of the profile
  ProfileBins(double begin, double end, double bin_length);

  /// Sorts samples in, in the order of the pixels.
  /// \param samples_of  appends those of a pixel; called on all threads
  void fill(std::size_t pixels, const std::function<void(std::size_t pixel, std::vector<Point>&)>& samples_of);
  /// Of each bin that is not empty the mean of what is near the median: humps and glints of single pixels stay out.
  std::vector<Point> robust_means() const;

 private:
  /// Which a sample belongs to; none: the number of bins.
  std::size_t bin_of(const Point& point) const;

  double begin_, bin_length_;
  std::size_t count_;
  std::vector<Point> points_;       ///< bin by bin
  std::vector<std::size_t> first_;  ///< of each bin, and the end
};

}  // namespace pagesweep
