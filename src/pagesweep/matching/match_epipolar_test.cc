// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/match_epipolar.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "pagesweep/base/instruction_sets_testing.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

using sim::AnalyticScene;

const AnalyticScene flat{[](double, double) { return 20.0; }};
const AnalyticScene tilted{[](double x, double y) { return 25 + 0.15 * x - 0.1 * y; }};
const AnalyticScene cylinder{[](double x, double) { return 30 + 25 * std::cos(x / 60); }};
/// An open book: two pages that rise steeply from the gutter and sink again.
const AnalyticScene gutter{[](double x, double) {
  const double a = std::abs(x);
  return 45 * (1 - std::exp(-a / 18)) - 0.12 * a;
}};
/// A plate of paper 25 mm above another.
const AnalyticScene step{[](double x, double y) { return std::abs(x) < 40 && std::abs(y) < 45 ? 45.0 : 20.0; }};

struct Errors {
  int matched = 0, should_match = 0, wrong = 0;
  double rms_px = 0, max_px = 0, normalised_variance = 0;
};

/// \param wrong_px  a match farther off is wrong
Errors compare(const Correspondences& matches, const Correspondences& truth, double wrong_px) {
  Errors e;
  for (int y = 0; y < truth.height(); ++y)
    for (int x = 0; x < truth.width(); ++x) {
      if (truth.status(x, y) == PixelStatus::ok) ++e.should_match;
      if (matches.status(x, y) != PixelStatus::ok) continue;
      ++e.matched;
      const double error = std::hypot(matches.u(x, y) - truth.u(x, y), matches.v(x, y) - truth.v(x, y));
      if (!(error <= wrong_px)) {
        ++e.wrong;
        continue;
      }
      e.max_px = std::max(e.max_px, error);
      e.rms_px += error * error;
      e.normalised_variance += std::pow(error / matches.sigma(x, y), 2);
    }
  e.rms_px = std::sqrt(e.rms_px / e.matched);
  e.normalised_variance /= e.matched;
  return e;
}

/// Noise that depends on the pixel alone.
void add_noise(TimeMap& map, unsigned seed) {
  for (int y = 0; y < map.height(); ++y) {
    std::mt19937 random(seed * 100000 + static_cast<unsigned>(y));
    std::normal_distribution<float> normal;
    for (int x = 0; x < map.width(); ++x) map.time(x, y) += map.sigma(x, y) * normal(random);
  }
}

struct Case {
  const char* name;
  const AnalyticScene* scene;
};

class MatchTimes : public testing::TestWithParam<Case> {
 protected:
  static constexpr int width_px = 200;
  const AnalyticScene& scene = *GetParam().scene;
  const Rig rig = sim::make_test_rig(width_px);
  const Camera& cam1 = rig.cameras[0];
  const Camera& cam2 = rig.cameras[1];
};

TEST_P(MatchTimes, FindsExactTimesToAHundredthOfAPixel) {
  const auto times1 = scene.times(cam1, *rig.light), times2 = scene.times(cam2, *rig.light);
  const MatchPair pair = match_times(times1, times2, cam1, cam2);
  for (const auto& [matches, truth] : {std::pair(&pair.from_first, scene.correspondences(cam1, cam2)),
                                       std::pair(&pair.from_second, scene.correspondences(cam2, cam1))}) {
    const Errors e = compare(*matches, truth, 0.5);
    EXPECT_EQ(e.wrong, 0);
    EXPECT_GT(e.matched, 0.98 * e.should_match);
    // Bilinear interpolation between exact times errs by an eighth of their second difference over a pixel.
    EXPECT_LT(e.rms_px, 0.01);
  }
}

TEST_P(MatchTimes, SigmaIsTrueUnderNoise) {
  auto times1 = scene.times(cam1, *rig.light, 0.03), times2 = scene.times(cam2, *rig.light, 0.03);
  add_noise(times1, 1);
  add_noise(times2, 2);
  const MatchPair pair = match_times(times1, times2, cam1, cam2);
  const Errors e = compare(pair.from_first, scene.correspondences(cam1, cam2), 0.5);
  EXPECT_EQ(e.wrong, 0);
  EXPECT_GT(e.matched, 0.98 * e.should_match);
  EXPECT_NEAR(e.normalised_variance, 1, 0.1);
}

INSTANTIATE_TEST_SUITE_P(Surfaces, MatchTimes,
                         testing::Values(Case{"flat", &flat}, Case{"tilted", &tilted}, Case{"cylinder", &cylinder},
                                         Case{"gutter", &gutter}),
                         [](const auto& test) { return test.param.name; });

TEST(MatchTimesOnAStep, GivesNoMatchThatIsNotThere) {
  const Rig rig = sim::make_test_rig(200);
  const Camera &cam1 = rig.cameras[0], &cam2 = rig.cameras[1];
  auto times1 = step.times(cam1, *rig.light, 0.02), times2 = step.times(cam2, *rig.light, 0.02);
  add_noise(times1, 3);
  add_noise(times2, 4);
  const MatchPair pair = match_times(times1, times2, cam1, cam2);
  const Correspondences truth = step.correspondences(cam1, cam2);
  int wrong = 0, matched = 0, should = 0;
  for (int y = 0; y < truth.height(); ++y)
    for (int x = 0; x < truth.width(); ++x) {
      if (truth.status(x, y) == PixelStatus::ok) ++should;
      if (pair.from_first.status(x, y) != PixelStatus::ok) continue;
      ++matched;
      const double error = std::hypot(pair.from_first.u(x, y) - truth.u(x, y), pair.from_first.v(x, y) - truth.v(x, y));
      if (!(error < 6 * pair.from_first.sigma(x, y))) ++wrong;
    }
  EXPECT_EQ(wrong, 0);
  EXPECT_GT(matched, 0.95 * should);  // `should` also counts what the upper plate hides from the other camera
}

class MatchTimesOfAFlatPage : public testing::Test {
 protected:
  const Rig rig = sim::make_test_rig(120);
  const Camera& cam1 = rig.cameras[0];
  const Camera& cam2 = rig.cameras[1];
  TimeMap times1 = flat.times(cam1, *rig.light);
  TimeMap times2 = flat.times(cam2, *rig.light);
};

TEST_F(MatchTimesOfAFlatPage, KeepsTheReasonOfAPixelWithoutTime) {
  times1.status(60, 60) = PixelStatus::saturated;
  times1.time(60, 60) = not_a_number;
  const MatchPair pair = match_times(times1, times2, cam1, cam2);
  EXPECT_EQ(pair.from_first.status(60, 60), PixelStatus::saturated);
  EXPECT_TRUE(std::isnan(pair.from_first.u(60, 60)));
  EXPECT_EQ(pair.from_first.status(59, 60), PixelStatus::ok);  // it needs only the other camera's pixels
}

TEST_F(MatchTimesOfAFlatPage, FindsNothingWhereTheOtherCameraHasNoTimes) {
  const Correspondences truth = flat.correspondences(cam1, cam2);
  const int u = static_cast<int>(truth.u(60, 60)), v = static_cast<int>(truth.v(60, 60));
  for (int y = v - 3; y <= v + 4; ++y)
    for (int x = u - 3; x <= u + 4; ++x) {
      times2.status(x, y) = PixelStatus::too_dark;
      times2.time(x, y) = not_a_number;
    }
  const MatchPair pair = match_times(times1, times2, cam1, cam2);
  EXPECT_EQ(pair.from_first.status(60, 60), PixelStatus::no_match);
}

TEST_F(MatchTimesOfAFlatPage, TwoEqualPlacesAreAmbiguous) {
  // The stripe passes the other camera's picture there and back: every time twice.
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 120; ++x) {
      times2.time(x, y) = static_cast<float>(std::abs(y - 60));
      times2.status(x, y) = PixelStatus::ok;
      times2.sigma(x, y) = 0.02f;
      times1.time(x, y) = 20;
      times1.status(x, y) = PixelStatus::ok;
      times1.sigma(x, y) = 0.02f;
    }
  MatchOptions options;
  options.near_mm = 400;
  options.far_mm = 1500;
  const MatchPair pair = match_times(times1, times2, cam1, cam2, options);
  int ambiguous = 0;
  for (const PixelStatus status : pair.from_first.status.pixels()) {
    EXPECT_NE(status, PixelStatus::ok);
    ambiguous += status == PixelStatus::ambiguous ? 1 : 0;
  }
  EXPECT_GT(ambiguous, 2000);  // elsewhere the curve shows only one of the places
}

TEST_F(MatchTimesOfAFlatPage, StrayLightWithTheSameTimesIsNoMatch) {
  // Behind the page's edge, dark pixels repeat the times of the bright ones before it, as in a mirror.
  const TimeMap seen = times2;
  const int edge = 50;
  for (int y = 0; y < edge; ++y)
    for (int x = 0; x < 120; ++x) {
      times2.time(x, y) = seen.time(x, 2 * edge - y);
      times2.status(x, y) = seen.status(x, 2 * edge - y);
      times2.sigma(x, y) = 0.2f;
      times2.amplitude(x, y) = 4;
    }
  const MatchPair pair = match_times(times1, times2, cam1, cam2);
  const Correspondences truth = flat.correspondences(cam1, cam2);
  int matched = 0;
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 120; ++x) {
      if (pair.from_first.status(x, y) != PixelStatus::ok || truth.status(x, y) != PixelStatus::ok) continue;
      EXPECT_NEAR(pair.from_first.v(x, y), truth.v(x, y), 0.1);
      ++matched;
    }
  EXPECT_GT(matched, 2000);
}

TEST_F(MatchTimesOfAFlatPage, KeepsWithinTheGivenDepths) {
  MatchOptions options;
  options.near_mm = 100;
  options.far_mm = 500;  // the page lies at 620 mm
  const MatchPair pair = match_times(times1, times2, cam1, cam2, options);
  for (const PixelStatus status : pair.from_first.status.pixels()) EXPECT_NE(status, PixelStatus::ok);
}

TEST_F(MatchTimesOfAFlatPage, DoesNotDependOnTheNumberOfThreads) {
  add_noise(times1, 5);
  add_noise(times2, 6);
  const MatchPair many = match_times(times1, times2, cam1, cam2);
  const ThreadLimit one(1);
  const MatchPair single = match_times(times1, times2, cam1, cam2);
  for (std::size_t i = 0; i < many.from_first.u.size(); ++i) {
    ASSERT_EQ(many.from_first.status.data()[i], single.from_first.status.data()[i]);
    if (many.from_first.status.data()[i] != PixelStatus::ok) continue;
    ASSERT_EQ(many.from_first.u.data()[i], single.from_first.u.data()[i]);
    ASSERT_EQ(many.from_first.sigma.data()[i], single.from_first.sigma.data()[i]);
  }
}

/// Neighbours lie side by side in the other picture, in reverse, or one below the other.
TEST_F(MatchTimesOfAFlatPage, FindsThemHoweverACameraIsTurnedWithEveryInstructionSet) {
  for (const double quarters : {0, 1, 2}) {
    Camera turned = cam2;
    const Eigen::AngleAxisd turn(quarters * M_PI / 2, Eigen::Vector3d::UnitZ());
    turned.cam_from_rig = Rigid3(turn.toRotationMatrix(), Eigen::Vector3d::Zero()) * cam2.cam_from_rig;
    const TimeMap times = flat.times(turned, *rig.light);
    const Correspondences truth = flat.correspondences(cam1, turned);
    on_every_instruction_set([&] {
      const Errors e = compare(match_times(times1, times, cam1, turned).from_first, truth, 0.5);
      EXPECT_EQ(e.wrong, 0) << quarters;
      EXPECT_GT(e.matched, 0.98 * e.should_match) << quarters;
      EXPECT_LT(e.rms_px, 0.01) << quarters;
    });
  }
}

TEST_F(MatchTimesOfAFlatPage, RefusesWhatContradictsItself) {
  MatchOptions options;
  options.near_mm = 800;
  options.far_mm = 700;
  EXPECT_THROW(match_times(times1, times2, cam1, cam2, options), std::invalid_argument);
  EXPECT_THROW(match_times(TimeMap(3, 3), times2, cam1, cam2), std::invalid_argument);
  EXPECT_THROW(match_times(times1, times1, cam1, cam1), std::invalid_argument);
}

}  // namespace
}  // namespace pagesweep
