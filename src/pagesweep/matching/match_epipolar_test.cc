// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/match_epipolar.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

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
  static constexpr int width_px = 320;
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

}  // namespace
}  // namespace pagesweep
