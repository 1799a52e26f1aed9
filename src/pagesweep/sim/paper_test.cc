// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/paper.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace pagesweep::sim {
namespace {

constexpr double degree = std::numbers::pi / 180;

SheetShape make_page(SheetEdge anchor, double apex_mm) {
  SheetShape shape;
  shape.width_mm = 120;
  shape.height_mm = 160;
  shape.anchor = anchor;
  shape.at_mm = {3, -4, 8};
  shape.turn_rad = 2 * degree;
  shape.apex_mm = apex_mm;
  shape.slopes = {{0, 50 * degree}, {12, 40 * degree}, {40, 10 * degree}, {80, -4 * degree}, {120, -9 * degree}};
  return shape;
}

// A chord over 2 degrees of arc is shorter than the arc by 5e-5 of it: all that a mesh of a developable may show.
TEST(BendSheet, NeverStretchesADevelopable) {
  for (const SheetEdge anchor : {SheetEdge::left, SheetEdge::right, SheetEdge::top, SheetEdge::bottom})
    for (const double apex_mm : {1e6, 900.0, -900.0}) {
      const Sheet sheet = bend_sheet(make_page(anchor, apex_mm), 1);
      EXPECT_LT(sheet.largest_strain, 7e-5) << name_of(anchor) << " " << apex_mm;
      EXPECT_GT(sheet.largest_strain, 0);
    }
}

TEST(BendSheet, ReadsAsAPageSeenFromAbove) {
  for (const SheetEdge anchor : {SheetEdge::left, SheetEdge::right, SheetEdge::top, SheetEdge::bottom}) {
    const GridMesh mesh = bend_sheet(make_page(anchor, 1e6), 2).mesh;
    const Eigen::Vector3d top_left = mesh.positions(0, 0), right = mesh.positions(mesh.columns() - 1, 0) - top_left,
                          down = mesh.positions(0, mesh.rows() - 1) - top_left;
    EXPECT_GT(right.x(), 80) << name_of(anchor);
    EXPECT_LT(down.y(), -80) << name_of(anchor);
    for (const Eigen::Vector3f& normal : mesh.normals.pixels()) EXPECT_GT(normal.z(), 0.5);
  }
}

TEST(BendSheet, StartsAtItsAnchoredEdgeWithTheGivenSlope) {
  const GridMesh mesh = bend_sheet(make_page(SheetEdge::left, 1e6), 1).mesh;
  const Eigen::Vector3d middle = mesh.point(mesh.spot_at(0, 80));
  EXPECT_LT((middle - Eigen::Vector3d(3, -4, 8)).norm(), 1e-5);
  const Eigen::Vector3d start = mesh.point(mesh.spot_at(0.5, 80)) - middle;
  EXPECT_NEAR(std::asin(start.z() / start.norm()), 50 * degree, 1 * degree);
}

TEST(BendSheet, KeepsTheNormalsAtRightAnglesToTheMesh) {
  for (const double apex_mm : {1e6, -700.0}) {
    SheetShape shape = make_page(SheetEdge::right, apex_mm);
    shape.dents = {{60, 80, -2, 18, 12, 0.3}};
    const GridMesh mesh = bend_sheet(shape, 1).mesh;
    for (int j = 1; j + 1 < mesh.rows(); j += 7)
      for (int i = 1; i + 1 < mesh.columns(); i += 7) {
        const Eigen::Vector3d across = (mesh.positions(i + 1, j) - mesh.positions(i - 1, j)).normalized();
        const Eigen::Vector3d along = (mesh.positions(i, j + 1) - mesh.positions(i, j - 1)).normalized();
        EXPECT_NEAR(mesh.normals(i, j).cast<double>().dot(across), 0, 0.01);
        EXPECT_NEAR(mesh.normals(i, j).cast<double>().dot(along), 0, 0.01);
      }
  }
}

// Without relaxation a Gaussian dent of height h and radius r stretches by (h / r)^2 / (2 e), here 0.0041.
TEST(BendSheet, LetsThePaperSlideIntoADent) {
  SheetShape shape = make_page(SheetEdge::left, 1e6);
  shape.slopes = {{0, 0}};
  shape.dents = {{60, 80, 3, 20, 20, 0}};
  const Sheet sheet = bend_sheet(shape, 1);
  const double unrelaxed = std::pow(3.0 / 20, 2) / (2 * std::numbers::e);
  EXPECT_LT(sheet.largest_strain, 0.6 * unrelaxed);
  EXPECT_NEAR(sheet.mesh.point(sheet.mesh.spot_at(60, 80)).z(), 8 + 3, 1e-3);
}

TEST(BendSheet, MakesALetterOfFlatFacets) {
  SheetShape shape = make_page(SheetEdge::top, 1e6);
  shape.slopes = {{0, -9 * degree}, {53, -9 * degree}, {53.28, 7 * degree}, {106, 7 * degree}, {106.2, -5 * degree}};
  shape.at_mm.z() = 12;
  const Sheet sheet = bend_sheet(shape, 1);
  EXPECT_LT(sheet.largest_strain, 2e-4);
  const auto height = [&](double t) { return sheet.mesh.point(sheet.mesh.spot_at(60, t)).z(); };
  EXPECT_NEAR(height(53) - height(0), -53 * std::sin(9 * degree), 1e-4);
  EXPECT_NEAR(height(106) - height(54), 52 * std::sin(7 * degree), 1e-3);
}

}  // namespace
}  // namespace pagesweep::sim
