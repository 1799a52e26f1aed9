// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/local_plane.h"

namespace pagesweep {

/// The pixels around those of a batch: place by place, row by row, the values of all its pixels.
struct PlaneWindow {
  int radius;
  float* values;  ///< less the pixel's own; NaN where there is none
  float* misses;  ///< room for as many
};

/// \see PlaneFitter::fit; all columns of the batch are read
void fit_planes(const ImageView<const float>& values, const PlaneWindow& window, PlaneBatch& batch);

/// By how much the value that keeps least to its pixel's plane exceeds what PlaneFitter::are_one_surface allows; 0 if
/// it does not, NaN without a plane.
/// \param window_values  as fit_planes() left them
void find_excess(const ImageView<const float>& sigmas, int radius, const float* window_values, const PlaneBatch& batch,
                 PlaneBatch::Each<float>& excess);

}  // namespace pagesweep
