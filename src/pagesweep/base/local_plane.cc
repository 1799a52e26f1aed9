// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/base/local_plane.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pagesweep/base/plane_sums_internal.h"

namespace pagesweep {

void Neighbourhood::set_radius(int radius) {
  radius_ = radius;
  const auto side = static_cast<std::size_t>(2 * radius + 1);
  const std::size_t padded = (side * side + plane_padding - 1) / plane_padding * plane_padding;
  i_.assign(padded, 0);
  j_.assign(padded, 0);
  values_.assign(padded, std::numeric_limits<float>::quiet_NaN());
  scratch_.resize(padded);
  for (std::size_t k = 0; k < side * side; ++k) {
    i_[k] = static_cast<float>(static_cast<int>(k % side) - radius);
    j_[k] = static_cast<float>(static_cast<int>(k / side) - radius);
  }
}

void Neighbourhood::gather(const Image<float>& values, int x, int y, int radius) {
  if (radius != radius_) set_radius(radius);
  const float middle = values(x, y);
  const int side = 2 * radius + 1;
  float* out = values_.data();
  const bool inside = x >= radius && y >= radius && x + radius < values.width() && y + radius < values.height();
  for (int row = y - radius; row <= y + radius; ++row, out += side) {
    if (inside) {
      const float* in = &values(x - radius, row);
      for (int k = 0; k < side; ++k) out[k] = in[k] - middle;
    } else {
      for (int k = 0; k < side; ++k)
        out[k] = values.contains(x - radius + k, row) ? values(x - radius + k, row) - middle
                                                      : std::numeric_limits<float>::quiet_NaN();
    }
  }
}

std::size_t Neighbourhood::size() const {
  return static_cast<std::size_t>(std::ranges::count_if(values_, [](float value) { return std::isfinite(value); }));
}

std::optional<LocalPlane> Neighbourhood::fit(const LocalPlane& before, float limit) const {
  const auto [n, i, j, ii, ij, jj, d, id, jd] =
      sum_near({i_.data(), j_.data(), values_.data(), values_.size()}, before, limit);
  if (n < 6) return std::nullopt;
  // About the centroid, the two slopes are a 2 x 2 system.
  const float cii = ii - i * i / n, cij = ij - i * j / n, cjj = jj - j * j / n;
  const float cid = id - i * d / n, cjd = jd - j * d / n;
  const float determinant = cii * cjj - cij * cij;
  if (!(determinant > 1e-3f * n * n)) return std::nullopt;
  const float across = (cid * cjj - cjd * cij) / determinant, down = (cjd * cii - cid * cij) / determinant;
  return LocalPlane{across, down, (d - across * i - down * j) / n};
}

std::optional<LocalPlane> Neighbourhood::fit() const { return fit({}, std::numeric_limits<float>::max()); }

std::optional<LocalPlane> Neighbourhood::fit_robustly() {
  const auto plane = fit();
  if (!plane) return plane;
  const auto [median, has_outliers] = median_miss(*plane);
  return has_outliers ? fit(*plane, 3 * median) : plane;
}

std::pair<float, bool> Neighbourhood::median_miss(const LocalPlane& plane) {
  const auto [median, largest] =
      find_misses({i_.data(), j_.data(), values_.data(), values_.size()}, plane, scratch_.data());
  return {median, largest > 3 * median};
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
