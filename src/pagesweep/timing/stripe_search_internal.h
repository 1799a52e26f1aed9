// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/timing/search_kernels_internal.h"
#include "pagesweep/timing/sensor_noise.h"

namespace pagesweep {

/// Finds where, roughly, the stripe passes each pixel of a row: the start values of all estimators.
///
/// Each gray value sequence is filtered with a box as long as the stripe minus the mean of two such boxes before and
/// after it: nearly a matched filter, blind to constant and slowly drifting light, and its cost does not depend on the
/// stripe's width. Samples count by their exposures' squares. The highest response is the most significant bell, be
/// there a second hump or a glint.
class StripeSearch {
 public:
  /// \param fwhm  full width of the stripe at half height [frames]
  explicit StripeSearch(double fwhm);

  /// \param samples  as Frames::read_row() makes them: one row a frame, NaN dropped, +infinity clipped
  /// \param noise    whose ceilings a clipped sample stands for at least
  /// \param clipped  whether a sample may be clipped
  void find(const Image<float>& samples, const FrameNoise& noise, bool clipped = true);

  /// Nearest to the bell's middle, to an eighth of the box.
  int frame(int x) const { return frame_[static_cast<std::size_t>(x)]; }
  float rise(int x) const { return rise_[static_cast<std::size_t>(x)]; }  ///< filter response [gray values]
  /// Standard deviation of rise() where only the sensor's read noise is seen.
  double rise_sigma(const FrameNoise& noise) const;

 private:
  void accumulate(const Image<float>& samples, const FrameNoise& noise);
  void filter();
  MeanOfFrames box_around(int centre) const;
  std::array<MeanOfFrames, 3> boxes_at(int i) const;
  void look_between(const FrameNoise& noise);
  void centre_clipped(const Image<float>& samples, const FrameNoise& noise);

  int box_;                     ///< [frames] odd
  int distance_;                ///< [frames] from the box to those beside it
  int stride_ = 1;              ///< [frames] from one response to the next
  Image<float> sums_;           ///< row i: weighted sum of the frames before i
  std::vector<float> weights_;  ///< i: sum of the weights of the frames before i
  std::vector<std::int32_t> frame_;
  std::vector<float> rise_;
};

}  // namespace pagesweep
