// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/base/local_plane.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pagesweep {

void Neighbourhood::gather(const Image<float>& values, int x, int y, int radius) {
  i_.clear();
  j_.clear();
  values_.clear();
  const float middle = values(x, y);
  const int top = std::max(0, y - radius), bottom = std::min(values.height() - 1, y + radius);
  const int left = std::max(0, x - radius), right = std::min(values.width() - 1, x + radius);
  for (int row = top; row <= bottom; ++row)
    for (int column = left; column <= right; ++column) {
      const float value = values(column, row);
      if (!std::isfinite(value)) continue;
      i_.push_back(static_cast<float>(column - x));
      j_.push_back(static_cast<float>(row - y));
      values_.push_back(value - middle);
    }
}

std::optional<LocalPlane> Neighbourhood::fit(const LocalPlane& before, float limit) const {
  float n = 0, i = 0, j = 0, ii = 0, ij = 0, jj = 0, d = 0, id = 0, jd = 0;
  for (std::size_t k = 0; k < size(); ++k) {
    const float use = std::abs(values_[k] - before.at(i_[k], j_[k])) <= limit ? 1.0f : 0.0f;
    const float ui = use * i_[k], uj = use * j_[k];
    n += use;
    i += ui;
    j += uj;
    ii += ui * i_[k];
    ij += ui * j_[k];
    jj += uj * j_[k];
    d += use * values_[k];
    id += ui * values_[k];
    jd += uj * values_[k];
  }
  if (n < 6) return std::nullopt;
  // About the centroid, the two slopes are a 2 x 2 system.
  const float cii = ii - i * i / n, cij = ij - i * j / n, cjj = jj - j * j / n;
  const float cid = id - i * d / n, cjd = jd - j * d / n;
  const float determinant = cii * cjj - cij * cij;
  if (!(determinant > 1e-3f * n * n)) return std::nullopt;
  const float across = (cid * cjj - cjd * cij) / determinant, down = (cjd * cii - cid * cij) / determinant;
  return LocalPlane{across, down, (d - across * i - down * j) / n};
}

std::optional<LocalPlane> Neighbourhood::fit() const { return fit({}, std::numeric_limits<float>::infinity()); }

std::optional<LocalPlane> Neighbourhood::fit_robustly() {
  const auto plane = fit();
  if (!plane) return plane;
  const auto [median, has_outliers] = median_miss(*plane);
  return has_outliers ? fit(*plane, 3 * median) : plane;
}

std::pair<float, bool> Neighbourhood::median_miss(const LocalPlane& plane) {
  misses_.clear();
  for (std::size_t k = 0; k < size(); ++k) misses_.push_back(std::abs(values_[k] - plane.at(i_[k], j_[k])));
  const auto middle = misses_.begin() + static_cast<std::ptrdiff_t>(misses_.size() / 2);
  std::nth_element(misses_.begin(), middle, misses_.end());
  return {*middle, *std::max_element(middle, misses_.end()) > 3 * *middle};
}

bool is_one_surface(const LocalPlane& plane, const Image<float>& values, const Image<float>& sigmas, int x, int y,
                    int radius) {
  const float half_pixel = 0.5f * std::hypot(plane.across, plane.down), here = values(x, y);
  const int top = std::max(0, y - radius), bottom = std::min(values.height() - 1, y + radius);
  const int left = std::max(0, x - radius), right = std::min(values.width() - 1, x + radius);
  for (int row = top; row <= bottom; ++row)
    for (int column = left; column <= right; ++column) {
      const float value = values(column, row);
      if (!std::isfinite(value)) continue;
      const float miss = value - here - plane.at(static_cast<float>(column - x), static_cast<float>(row - y));
      if (std::abs(miss) > half_pixel + 6 * sigmas(column, row)) return false;
    }
  return true;
}

}  // namespace pagesweep
