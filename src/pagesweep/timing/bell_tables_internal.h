// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "pagesweep/timing/stripe_profile.h"

namespace pagesweep {

/// A stripe of one width as whole frames sample it, at all sub-frame phases, and the weights by which samples of even
/// noise tell amplitude, background and time.
///
/// Row q of a table is for a bell whose middle lies phase_of(q) after a whole frame; its entry k is for the sample
/// k - reach frames from that frame, and 0 from 2 reach + 1 on. Tables have `phases + 1` rows of `length` entries.
struct BellTable {
  static constexpr int phases = 32;  ///< a frame
  static double phase_of(int row) { return static_cast<double>(row) / phases - 0.5; }
  /// The row for a bell `phase` frames after a whole frame.
  static int row_of(double phase) { return static_cast<int>((phase + 0.5) * phases + 0.5); }

  float log_width = 0;                                                   ///< relative to the profile
  float width = 1;                                                       ///< likewise
  int reach = 0;                                                         ///< [frames] to both sides
  int length = 0;                                                        ///< 2 reach + 1, rounded up to whole vectors
  std::vector<float> value, slope;                                       ///< of the profile; slope by frames
  std::vector<float> amplitude_weight, background_weight, slope_weight;  ///< least squares solution
  std::vector<float> inside;                                             ///< [length] 1 for samples within reach
  std::vector<float> rising, falling;                                    ///< [phases + 1] sums of squared slopes

  /// The profile where a stretch of `frames`, as high at its beginning as at its end if the profile is symmetric,
  /// begins and ends: the mean of both.
  float height_over(int frames) const {
    // Half frames are those of the first row's.
    const int half = frames / 2, is_odd = frames % 2;
    const auto row = static_cast<std::size_t>(is_odd ? 0 : phases / 2 * length);
    if (half >= reach) return 0;
    return 0.5F * (value[row + static_cast<std::size_t>(reach - half - is_odd)] +
                   value[row + static_cast<std::size_t>(reach + half)]);
  }
  /// What the samples of one flank, 0: rising, 1: falling, tell about the time: their sum of squared slopes.
  double flank(int side, int row) const {
    return static_cast<double>((side == 0 ? rising : falling)[static_cast<std::size_t>(row)]);
  }
};

/// Tables for all stripe widths, a percent apart. What lies between two rows is reached by the slope: an error below
/// 1e-4 of the amplitude.
class BellTables {
 public:
  /// \param reach  [frames] to both sides of the middle at width 1: how much of a pixel's samples is to be used
  BellTables(const StripeProfile& profile, double reach);

  /// Makes the tables for these widths, narrowest and widest, relative to the profile.
  void cover(std::pair<double, double> widths);
  /// The nearest one. \pre the width is covered
  const BellTable& at(double log_width) const { return *tables_[index_of(log_width)]; }
  /// [frames] that any table reaches to both sides.
  int longest_reach() const;

 private:
  static std::size_t index_of(double log_width);

  const StripeProfile& profile_;
  double reach_;
  std::vector<std::unique_ptr<const BellTable>> tables_;
};

}  // namespace pagesweep
