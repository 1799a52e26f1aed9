// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/data/page_surface.h"

#include <gtest/gtest.h>

#include <cmath>

namespace pagesweep {
namespace {

PageSurface cylinder_of_radius(double radius_mm, double spacing_mm) {
  PageSurface surface;
  surface.spacing_mm = spacing_mm;
  surface.s0_mm = -20;
  surface.t0_mm = 5;
  surface.model = Image<Eigen::Vector3f>(41, 11);
  for (int j = 0; j < surface.rows(); ++j)
    for (int i = 0; i < surface.columns(); ++i) {
      const double angle = surface.s_of(i) / radius_mm;
      surface.model(i, j) =
          Eigen::Vector3d(radius_mm * std::sin(angle), -surface.t_of(j), radius_mm * std::cos(angle)).cast<float>();
    }
  return surface;
}

TEST(PageSurface, InterpolatesACurvedSheetToMicrometres) {
  // Catmull-Rom leaves an error of about spacing^3 / (18 radius^2) between nodes: 1 / (18 * 900) mm here, at the most.
  const PageSurface surface = cylinder_of_radius(30, 1);
  for (double s = -18.7; s < 18; s += 0.31) {
    const Eigen::Vector3d p = interpolate(surface, surface.model, s, 7.77);
    EXPECT_NEAR(p.x(), 30 * std::sin(s / 30), 1e-4);
    EXPECT_NEAR(p.y(), -7.77, 1e-5);
    EXPECT_NEAR(p.z(), 30 * std::cos(s / 30), 1e-4);
  }
}

TEST(PageSurface, GoesOnStraightBeyondItsGrid) {
  PageSurface surface = cylinder_of_radius(1e7, 1);  // as good as flat
  for (const auto& [s, t] : {std::pair{-25.5, 3.0}, {-20.4, 4.9}, {20.5, 15.2}, {33.0, 40.0}, {0.0, -7.0}}) {
    const Eigen::Vector3d p = interpolate(surface, surface.model, s, t);
    EXPECT_NEAR(p.x(), s, 1e-4);
    EXPECT_NEAR(p.y(), -t, 1e-4);
  }
}

TEST(PageSurface, SumsUpStrainOfWhatIsMeasured) {
  PageSurface surface = cylinder_of_radius(30, 1);
  EXPECT_EQ(summarise_strain(surface).rms, 0) << "not computed";
  surface.strain = surface.strain_sigma = Image<float>(41, 11, 1e-4f);
  surface.status = Image<PixelStatus>(41, 11, PixelStatus::ok);
  EXPECT_NEAR(summarise_strain(surface).rms, 1e-4, 1e-9);
  EXPECT_EQ(summarise_strain(surface).unexplained_share, 0);
  surface.strain(3, 4) = -2e-3f;
  EXPECT_NEAR(summarise_strain(surface).unexplained_share, 1.0 / 451, 1e-9);
  surface.strain_sigma(3, 4) = 1e-3f;
  EXPECT_EQ(summarise_strain(surface).unexplained_share, 0) << "noise explains it";
  surface.strain(3, 4) = 1;
  surface.status(3, 4) = PixelStatus::covered;
  EXPECT_NEAR(summarise_strain(surface).rms, 1e-4, 1e-9) << "a guess does not count";
  EXPECT_NEAR(covered_share(surface), 1.0 / 451, 1e-9);
}

}  // namespace
}  // namespace pagesweep
