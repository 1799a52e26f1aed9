// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/data/page_surface.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "pagesweep/base/catmull_rom.h"

namespace pagesweep {
namespace {

/// Node (i, j), linearly extrapolated where it is beyond the grid's edge.
Eigen::Vector3d node(const Image<Eigen::Vector3f>& nodes, int i, int j) {
  const auto along_row = [&](int row) -> Eigen::Vector3d {
    const int last = nodes.width() - 1;
    const int inside = std::clamp(i, 0, last);
    const Eigen::Vector3d at = nodes(inside, row).cast<double>();
    if (inside == i || last == 0) return at;
    const Eigen::Vector3d before = nodes(i < 0 ? 1 : last - 1, row).cast<double>();
    return at + std::abs(i - inside) * (at - before);
  };
  const int last = nodes.height() - 1;
  const int inside = std::clamp(j, 0, last);
  const Eigen::Vector3d at = along_row(inside);
  if (inside == j || last == 0) return at;
  return at + std::abs(j - inside) * (at - along_row(j < 0 ? 1 : last - 1));
}

/// The weighted sum of 4 x 4 nodes, the first of which is (i, j), as rows of twelve numbers.
Eigen::Vector3d interpolate_inside(const Image<Eigen::Vector3f>& nodes, int i, int j, const std::array<double, 4>& wi,
                                   const std::array<double, 4>& wj) {
  std::array<double, 12> row{};
  for (int b = 0; b < 4; ++b) {
    const float* node = nodes(i, j + b).data();
    for (std::size_t k = 0; k < 12; ++k) row[k] += wj[static_cast<std::size_t>(b)] * static_cast<double>(node[k]);
  }
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t a = 0; a < 4; ++a) sum += wi[a] * Eigen::Map<const Eigen::Vector3d>(&row[3 * a]);
  return sum;
}

}  // namespace

Eigen::Vector3d interpolate(const PageSurface& surface, const Image<Eigen::Vector3f>& nodes, double s_mm, double t_mm) {
  const auto cell = [](double position, int count) {
    return static_cast<int>(std::clamp(std::floor(position), -1.0, std::max(0.0, count - 1.0)));
  };
  const double i = (s_mm - surface.s0_mm) / surface.spacing_mm;
  const double j = (t_mm - surface.t0_mm) / surface.spacing_mm;
  const int i0 = cell(i, nodes.width());
  const int j0 = cell(j, nodes.height());
  // Beyond the outermost extrapolated cell the interpolant goes on as a straight line.
  const double di = std::clamp(i - i0, 0.0, 1.0);
  const double dj = std::clamp(j - j0, 0.0, 1.0);
  const auto wi = catmull_rom_weights(di);
  const auto wj = catmull_rom_weights(dj);
  if (i0 >= 1 && j0 >= 1 && i0 + 2 < nodes.width() && j0 + 2 < nodes.height())
    return interpolate_inside(nodes, i0 - 1, j0 - 1, wi, wj);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int b = 0; b < 4; ++b)
    for (int a = 0; a < 4; ++a)
      sum += wi[static_cast<std::size_t>(a)] * wj[static_cast<std::size_t>(b)] * node(nodes, i0 - 1 + a, j0 - 1 + b);
  if (const double beyond = i - i0 - di; beyond != 0) sum += beyond * (node(nodes, i0 + 1, j0) - node(nodes, i0, j0));
  if (const double beyond = j - j0 - dj; beyond != 0) sum += beyond * (node(nodes, i0, j0 + 1) - node(nodes, i0, j0));
  return sum;
}

StrainSummary summarise_strain(const PageSurface& surface) {
  constexpr float strain_that_matters = 5e-4f, explained_sigmas = 4;
  double nodes = 0, squares = 0, unexplained = 0;
  for (std::size_t k = 0; k < surface.strain.size(); ++k) {
    const float strain = surface.strain.data()[k], sigma = surface.strain_sigma.data()[k];
    if (surface.status.data()[k] != PixelStatus::ok || !std::isfinite(strain)) continue;
    ++nodes;
    squares += double(strain) * strain;
    unexplained += std::abs(strain) > std::max(strain_that_matters, explained_sigmas * sigma);
  }
  if (nodes == 0) return {};
  return {std::sqrt(squares / nodes), unexplained / nodes};
}

double covered_share(const PageSurface& surface) {
  if (surface.status.size() == 0) return 0;
  const auto covered = std::ranges::count(surface.status.pixels(), PixelStatus::covered);
  return static_cast<double>(covered) / static_cast<double>(surface.status.size());
}

}  // namespace pagesweep
