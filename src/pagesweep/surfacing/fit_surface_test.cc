// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/fit_surface.h"

#include <gtest/gtest.h>

#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/surfacing/scenes_for_tests.h"

namespace pagesweep {
namespace {

using scenes::flattening_error;
using scenes::measure;

const double nan = std::numeric_limits<double>::quiet_NaN();
const Eigen::Vector2d no_paper(nan, nan);

void expect_book(const std::vector<PageSurface>& pages, const scenes::OpenBook& book) {
  ASSERT_EQ(pages.size(), 2u);
  for (const PageSurface& page : pages) {
    const int side = page.index == 1 ? -1 : 1;
    const auto paper = [&](double x, double y) { return book.paper(x, y, side); };
    const auto model = flattening_error(page, page.model, paper);
    const auto measured = flattening_error(page, page.measured, paper);
    EXPECT_GT(model.nodes, 5000);
    // 0.08 mm of noise a point, some hundred points a neighbourhood, seen under 20 degrees: 0.003 mm in the paper; at
    // the gutter and the outer edges a few times that.
    EXPECT_LT(model.rms_mm, 0.01);
    EXPECT_LT(measured.rms_mm, 0.015);
    EXPECT_NEAR(model.scale, 1, 5e-4);
    EXPECT_EQ(page.gutter_at_left, side > 0);
    EXPECT_EQ(page.gutter_at_right, side < 0);
    for (int j = 4; j + 4 < page.rows(); ++j) {
      const Eigen::Vector3f end = page.model(side < 0 ? page.columns() - 1 : 0, j);
      EXPECT_LT(std::abs(book.book_from_rig(end.x(), end.y()).x()), 0.5) << "the grid ends at the gutter";
    }
  }
}

TEST(FitSurface, FlattensAnOpenBookWithASteepGutter) {
  const scenes::OpenBook book;
  expect_book(fit_surface(measure(book.scene())), book);
}

TEST(FitSurface, IsNotMisledByOutliers) {
  const scenes::OpenBook book;
  expect_book(fit_surface(measure(book.scene(), {.drop = 0.05, .outliers = 0.05})), book);
}

TEST(FitSurface, LaysAPlaneFlatExactly) {
  const auto height = [](double x, double y) {
    return std::abs(x) < 90 && std::abs(y) < 120 ? 30 + 0.12 * x - 0.07 * y : nan;
  };
  const auto pages = fit_surface(measure({height, 60, 0}));
  ASSERT_EQ(pages.size(), 1u);
  const PageSurface& page = pages[0];
  // Orthonormal axes in the plane, the first one seen from above along x.
  const Eigen::Vector3d normal = Eigen::Vector3d(-0.12, 0.07, 1).normalized();
  const Eigen::Vector3d across = Eigen::Vector3d(1, 0, 0.12).normalized();
  const Eigen::Vector3d up = normal.cross(across);
  const auto error = flattening_error(page, page.model, [&](double x, double y) -> Eigen::Vector2d {
    if (std::isnan(height(x, y))) return no_paper;
    const Eigen::Vector3d point(x, y, 0.12 * x - 0.07 * y);
    return {point.dot(across), -point.dot(up)};
  });
  EXPECT_LT(error.largest_mm, 0.02);
  EXPECT_NEAR(error.scale, 1, 2e-5);
  double worst = 0;
  for (int j = 0; j < page.rows(); ++j)
    for (int i = 0; i < page.columns(); ++i) {
      const Eigen::Vector3f p = page.model(i, j);
      worst = std::max(worst, std::abs(p.z() - 30 - 0.12 * p.x() + 0.07 * p.y()));
    }
  EXPECT_LT(worst, 0.05) << "8 mm of extrapolation included";
}

TEST(FitSurface, KnowsTheArcLengthOfACylinder) {
  const double radius = 120;
  const auto height = [&](double x, double y) {
    return std::abs(x) < 90 && std::abs(y) < 120 ? std::sqrt(radius * radius - x * x) - 70 : nan;
  };
  const auto pages = fit_surface(measure({height, 60, 0}));
  ASSERT_EQ(pages.size(), 1u);
  const auto error = flattening_error(pages[0], pages[0].model, [&](double x, double y) -> Eigen::Vector2d {
    if (std::isnan(height(x, y))) return no_paper;
    return {radius * std::asin(x / radius), -y};
  });
  EXPECT_LT(error.largest_mm, 0.03);
}

/// Part of a cone with its apex 450 mm below the page: z = base + r h(psi), psi = angle at the apex against y.
struct Cone {
  static constexpr double apex_y = -450, base = 20;
  static double h(double psi) { return 0.045 * std::cos(10 * psi); }
  static double h_slope(double psi) { return -0.45 * std::sin(10 * psi); }
  static double height(double x, double y) {
    if (!(std::abs(x) < 90 && std::abs(y) < 110)) return nan;
    return base + std::hypot(x, y - apex_y) * h(std::atan2(x, y - apex_y));
  }
  /// Unrolled: distance from the apex r sqrt(1 + h^2), angle = integral of sqrt(1 + h^2 + h'^2) / (1 + h^2) dpsi.
  static Eigen::Vector2d paper(double x, double y) {
    if (std::isnan(height(x, y))) return no_paper;
    const double psi = std::atan2(x, y - apex_y);
    double angle = 0;
    const int steps = 200;
    for (int k = 0; k < steps; ++k) {
      const double p = (k + 0.5) / steps * psi;
      angle += psi / steps * std::sqrt(1 + h(p) * h(p) + h_slope(p) * h_slope(p)) / (1 + h(p) * h(p));
    }
    const double distance = std::hypot(x, y - apex_y) * std::sqrt(1 + h(psi) * h(psi));
    return {distance * std::sin(angle), -distance * std::cos(angle)};
  }
};

TEST(FitSurface, UnrollsACone) {
  const auto points = measure({Cone::height, 56, -8}, {.width_px = 192});
  for (const SurfaceModel model : {SurfaceModel::cylinder, SurfaceModel::developable}) {
    const auto pages = fit_surface(points, {.model = model});
    ASSERT_EQ(pages.size(), 1u);
    const auto error = flattening_error(pages[0], pages[0].model, Cone::paper);
    EXPECT_LT(error.rms_mm, 0.05);
    EXPECT_NEAR(error.scale, 1, 5e-4);
  }
}

/// A sheet whose right corners both curl up: cylinders of 80 mm radius about lines that run diagonally, one against the
/// other, which no ruled surface with rulings in one direction can be.
struct CurledCorners {
  static constexpr double radius = 80, begin = 66;
  static double beyond(double x, double y) { return std::max(0.0, (x + std::abs(y)) / std::numbers::sqrt2 - begin); }
  static double height(double x, double y) {
    const double d = beyond(x, y);
    if (!(std::abs(x) < 90 && std::abs(y) < 110) || d > 0.65 * radius) return nan;
    return 10 + radius - std::sqrt(radius * radius - d * d);
  }
  static Eigen::Vector2d paper(double x, double y) {
    if (std::isnan(height(x, y))) return no_paper;
    const double d = beyond(x, y), longer = (radius * std::asin(d / radius) - d) / std::numbers::sqrt2;
    return {x + longer, -(y + std::copysign(longer, y))};
  }
};

TEST(FitSurface, LaysFlatByTheMeasurementWhatNoModelDescribes) {
  const auto points = measure({CurledCorners::height, 40, 8}, {.width_px = 192});
  const auto model = fit_surface(points, {.model = SurfaceModel::cylinder, .layout = Layout::single});
  const auto free = fit_surface(points, {.model = SurfaceModel::developable, .layout = Layout::single});
  ASSERT_EQ(model.size(), 1u);
  ASSERT_EQ(free.size(), 1u);
  const auto by_model = flattening_error(model[0], model[0].measured, CurledCorners::paper);
  const auto by_measurement = flattening_error(free[0], free[0].measured, CurledCorners::paper);
  EXPECT_EQ(free[0].model_name, "developable");
  // The median is 0.02 mm; the rest sits at the ends of the curls, where the points end on a slope of 40 degrees.
  EXPECT_LT(by_measurement.rms_mm, 0.15);
  EXPECT_NEAR(by_measurement.scale, 1, 5e-4);
  EXPECT_LT(by_measurement.rms_mm, by_model.rms_mm / 4);
}

TEST(FitSurface, FindsTheGutterOfABookThatIsOpenAtItsFirstPage) {
  // The left side lies flat, only the right one rises.
  const scenes::OpenBook book;
  const auto height = [&](double x, double y) {
    const double z = book.height(x, y);
    return x < book.gutter_p_mm && !std::isnan(z) ? book.bottom_mm : z;
  };
  EXPECT_EQ(fit_surface(measure({height, 50, 5}, {.width_px = 160})).size(), 2u);
}

TEST(FitSurface, FollowsADentThatTheModelMisses) {
  const auto sheet = [](double x, double y) {
    return std::abs(x) < 90 && std::abs(y) < 110 ? 25 + 0.0015 * x * x : nan;
  };
  // 3 mm deep and 20 mm wide at half depth
  const auto dent = [](double x, double y) {
    return -3 * std::exp(-(std::pow(x - 20, 2) + std::pow(y + 15, 2)) / (2 * 8.5 * 8.5));
  };
  const auto pages = fit_surface(measure({[&](double x, double y) { return sheet(x, y) + dent(x, y); }, 60, 0}));
  ASSERT_EQ(pages.size(), 1u);
  double model_squares = 0, measured_squares = 0, worst = 0;
  int nodes = 0;
  for (int j = 0; j < pages[0].rows(); ++j)
    for (int i = 0; i < pages[0].columns(); ++i) {
      const Eigen::Vector3f a = pages[0].model(i, j), b = pages[0].measured(i, j);
      if (std::isnan(sheet(a.x(), a.y())) || pages[0].status(i, j) != PixelStatus::ok) continue;
      const double error = b.z() - sheet(b.x(), b.y()) - dent(b.x(), b.y());
      model_squares += std::pow(a.z() - sheet(a.x(), a.y()) - dent(a.x(), a.y()), 2);
      measured_squares += error * error;
      worst = std::max(worst, std::abs(error));
      ++nodes;
    }
  EXPECT_GT(nodes, 8000);
  EXPECT_GT(std::sqrt(model_squares / nodes), 0.2);
  EXPECT_LT(std::sqrt(measured_squares / nodes), 0.04);
  EXPECT_LT(worst, 0.4);
}

TEST(FitSurface, BridgesHolesAndSaysSo) {
  const scenes::OpenBook book;
  const auto in_hole = [](double x, double y) { return std::hypot(x - 60, y - 20) < 15; };
  const auto pages = fit_surface(measure(book.scene(), {.hole = in_hole}));
  expect_book(pages, book);
  int missing = 0, wrong = 0;
  for (int j = 0; j < pages[1].rows(); ++j)
    for (int i = 0; i < pages[1].columns(); ++i) {
      const Eigen::Vector3f p = pages[1].measured(i, j);
      if (std::hypot(p.x() - 60, p.y() - 20) > 11) continue;
      ++missing;
      wrong += pages[1].status(i, j) != PixelStatus::saturated || !std::isnan(pages[1].sigma(i, j));
      EXPECT_NEAR(p.z(), book.height(p.x(), p.y()), 0.2);
    }
  EXPECT_GT(missing, 80);
  EXPECT_EQ(wrong, 0);
}

TEST(FitSurface, ReadsInAnyDirection) {
  for (const double quarter : {1.0, 2.0}) {
    const double angle = quarter * std::numbers::pi / 2;
    scenes::OpenBook book;
    book.turn_rad += angle;
    const auto pages = fit_surface(measure(book.scene(), {.width_px = 192}), {.reading_direction_rad = angle});
    expect_book(pages, book);
    for (const PageSurface& page : pages) {
      const auto error = flattening_error(
          page, page.model, [&](double x, double y) { return book.paper(x, y, page.index == 1 ? -1 : 1); });
      EXPECT_LT(std::abs(error.turn_rad), 2e-3) << "(s, t) is oriented as the page is read";
    }
  }
}

/// A letter that was folded twice: creases of 11 degrees across the page.
double folded_letter(double x, double y) {
  if (!(std::abs(x) < 95 && std::abs(y) < 120)) return nan;
  return 12 + 0.1 * std::abs(y - 40) - 0.1 * std::abs(y + 40);
}

TEST(FitSurface, LeavesAFoldedLetterWhole) {
  const auto pages = fit_surface(measure({folded_letter, 21, 3}));
  ASSERT_EQ(pages.size(), 1u);
  const auto error = flattening_error(pages[0], pages[0].measured, [](double x, double y) -> Eigen::Vector2d {
    if (std::isnan(folded_letter(x, y))) return no_paper;
    const double slope = std::sqrt(1 + 0.04), middle = std::clamp(y, -40.0, 40.0);
    return {x, -(middle * slope + y - middle)};
  });
  EXPECT_LT(error.rms_mm, 0.1);
}

TEST(FitSurface, LeavesTheDarkTableAside) {
  const scenes::OpenBook book;
  const auto with_table = [&](double x, double y) {
    const double z = book.height(x, y);
    return std::isnan(z) ? 0.0 : z;
  };
  // A dark photo fills the lower outer corner of the right page.
  const auto brightness = [&](double x, double y) {
    if (std::isnan(book.height(x, y))) return 15.0;
    return x > 60 && y < -40 ? 12.0 : 100.0;
  };
  const auto pages = fit_surface(measure({with_table, 50, -2}, {.width_px = 192, .brightness = brightness}));
  expect_book(pages, book);
  for (const PageSurface& page : pages) {
    EXPECT_NEAR(page.s_of(page.columns() - 1) - page.s0_mm, 148, 5);
    EXPECT_NEAR(page.t_of(page.rows() - 1) - page.t0_mm, 216, 8);
  }
}

TEST(FitSurface, SaysWhatIsMissingWhenThereAreTooFewPoints) {
  const std::vector<PointMap> empty{PointMap(64, 64)};
  try {
    fit_surface(empty);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::no_result);
    EXPECT_NE(std::string(error.what()).find("status maps"), std::string::npos);
  }
  EXPECT_THROW(fit_surface({}), std::invalid_argument);
}

TEST(FitSurface, EndsInAPlaneWithFewPoints) {
  const auto plane = [](double x, double y) { return std::abs(x) < 20 && std::abs(y) < 20 ? 10 + 0.1 * x : nan; };
  const auto pages = fit_surface(measure({plane, 60, 0}, {.width_px = 56}));
  ASSERT_EQ(pages.size(), 1u);
  for (const Eigen::Vector3f& p : pages[0].model.pixels()) EXPECT_NEAR(p.z(), 10 + 0.1 * p.x(), 0.3);
}

TEST(FitSurface, DoesNotDependOnTheNumberOfThreads) {
  const scenes::OpenBook book;
  const auto points = measure(book.scene(), {.width_px = 128});
  const auto all = fit_surface(points);
  const ThreadLimit one(1);
  const auto single = fit_surface(points);
  ASSERT_EQ(all.size(), single.size());
  for (std::size_t k = 0; k < all.size(); ++k) {
    EXPECT_TRUE(std::ranges::equal(all[k].model.pixels(), single[k].model.pixels()));
    EXPECT_TRUE(std::ranges::equal(all[k].measured.pixels(), single[k].measured.pixels()));
  }
}

}  // namespace
}  // namespace pagesweep
