// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/base/local_plane.h"

#include <algorithm>

#include "pagesweep/base/plane_kernels_internal.h"

namespace pagesweep {

PlaneFitter::PlaneFitter(int radius)
    : radius_(radius),
      window_(PlaneBatch::most, (2 * radius + 1) * (2 * radius + 1)),
      misses_(window_.width(), window_.height()) {}

void PlaneFitter::fit(const Image<float>& values, PlaneBatch& batch) {
  // Lanes that are left over do again what the last pixel's does.
  if (batch.count > 0) std::fill(batch.column.begin() + batch.count, batch.column.end(), batch.column[batch.count - 1]);
  fit_planes(values.view(), {radius_, window_.data(), misses_.data()}, batch);
}

PlaneBatch::Each<bool> PlaneFitter::are_one_surface(const Image<float>& sigmas, const PlaneBatch& batch) const {
  PlaneBatch::Each<float> excess;
  find_excess(sigmas.view(), radius_, window_.data(), batch, excess);
  PlaneBatch::Each<bool> are;
  std::ranges::transform(excess, are.begin(), [](float most) { return most <= 0; });
  return are;
}

std::optional<LocalPlane> fit_plane(const Image<float>& values, int x, int y, int radius) {
  PlaneFitter fitter(radius);
  PlaneBatch batch;
  batch.row = y;
  batch.column[batch.count++] = x;
  fitter.fit(values, batch);
  return batch.found(0) ? std::optional(batch.plane(0)) : std::nullopt;
}

}  // namespace pagesweep
