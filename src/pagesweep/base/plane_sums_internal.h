// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "pagesweep/base/local_plane.h"

namespace pagesweep {

/// Values at places (i, j) around a pixel. `count` is a multiple of `plane_padding`; a place without a value holds NaN.
struct PlanePlaces {
  const float* i;
  const float* j;
  const float* value;
  std::size_t count;
};
inline constexpr std::size_t plane_padding = 16;

/// Sums over the places that take part, for the normal equations of a plane.
struct PlaneSums {
  float n = 0, i = 0, j = 0, ii = 0, ij = 0, jj = 0, d = 0, id = 0, jd = 0;
};

/// Over the values that miss `before` by at most `limit`, a finite number.
PlaneSums sum_near(const PlanePlaces& places, const LocalPlane& before, float limit);

/// Median (to a hundredth of itself, from above) and largest of the distances from a plane; both 0 without values.
struct Misses {
  float median = 0, largest = 0;
};
/// \param scratch  room for places.count values
Misses find_misses(const PlanePlaces& places, const LocalPlane& plane, float* scratch);

}  // namespace pagesweep
