// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/camera/valid_radius.h"

namespace pagesweep {

double largest_valid_radius_squared(const BrownConrady& lens) {
  double valid = 0, beyond = 16;
  if (lens.is_valid_at(beyond)) return beyond;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (valid + beyond);
    (lens.is_valid_at(middle) ? valid : beyond) = middle;
  }
  return valid;
}

}  // namespace pagesweep
