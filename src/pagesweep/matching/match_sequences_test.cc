// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/match_sequences.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <utility>

#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

using sim::AnalyticScene;

const AnalyticScene cylinder{[](double x, double) { return 30 + 25 * std::cos(x / 60); }};
const AnalyticScene step{[](double x, double y) { return std::abs(x) < 40 && std::abs(y) < 45 ? 45.0 : 20.0; }};

/// Light of pattern i at a place of the surface, 0 to 1.
using Pattern = std::function<double(int i, double x_mm, double y_mm)>;

/// Stripes of a Gray code across the sweep, the finest 16 mm wide with edges blurred over some millimetres; each
/// pattern is followed by its inverse.
double gray_code(int i, double, double y) {
  const double radians_per_mm = M_PI / 500 * std::pow(2.0, i / 2);
  const double wave = -std::cos(radians_per_mm * (y + 250));
  const double share = 0.5 + 0.5 * std::tanh(wave / radians_per_mm / 2.5);
  return i % 2 == 0 ? share : 1 - share;
}

/// Waves of random direction and phase, 25 to 60 mm long.
struct RandomWaves {
  struct Wave {
    double along_x, along_y, phase;
  };
  std::array<std::array<Wave, 3>, 16> waves{};

  RandomWaves() {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> uniform;
    for (auto& frame : waves)
      for (Wave& wave : frame) {
        const double k = 2 * M_PI / (25 + 35 * uniform(random)), angle = M_PI * uniform(random);
        wave = {k * std::cos(angle), k * std::sin(angle), 2 * M_PI * uniform(random)};
      }
  }
  double operator()(int i, double x, double y) const {
    double light = 0.5;
    for (const Wave& wave : waves[static_cast<std::size_t>(i)])
      light += 0.16 * std::sin(wave.along_x * x + wave.along_y * y + wave.phase);
    return light;
  }
};
const RandomWaves random_waves;

/// The stripe of a scanner, three frames wide (sigma), 8 mm a frame.
double sweep(int i, double, double y) {
  const double frames = i - (y + 170) / 8;
  return std::exp(-frames * frames / 18);
}

struct Exposure {
  double amplitude = 180;  ///< [gray values] of full light on white paper
  double black = 2;
  double noise = 1.5;
};

Frames expose(const AnalyticScene& scene, const Camera& camera, const Pattern& pattern, int count, Exposure exposure,
              unsigned seed) {
  Frames frames({camera.name, camera.width, camera.height, count, 8, exposure.black, 255});
  const PointMap points = scene.points(camera);
  parallel_rows(count, [&](int i) {
    std::mt19937 random(seed * 1000 + static_cast<unsigned>(i));
    std::normal_distribution<double> noise(0, exposure.noise);
    Image<std::uint8_t> image(camera.width, camera.height);
    for (int y = 0; y < camera.height; ++y)
      for (int x = 0; x < camera.width; ++x) {
        const bool seen = points.status(x, y) == PixelStatus::ok;
        const double light = seen ? pattern(i, points.x(x, y), points.y(x, y)) : 0;
        const double gray = exposure.black + exposure.amplitude * light + noise(random);
        image(x, y) = static_cast<std::uint8_t>(std::lround(std::clamp(gray, 0.0, 255.0)));
      }
    frames.set(i, std::move(image));
  });
  return frames;
}

struct Result {
  int matched = 0, should_match = 0, wrong = 0;
  double rms_px = 0, normalised_rms = 0;
};

/// Judges the matches of camera `from` by where `to` images the points that it sees, be that in the picture or not.
Result compare(const Correspondences& matches, const AnalyticScene& scene, const Camera& from, const Camera& to) {
  const PointMap points = scene.points(from);
  Result r;
  for (int y = 0; y < from.height; ++y)
    for (int x = 0; x < from.width; ++x) {
      const Eigen::Vector3d point(points.x(x, y), points.y(x, y), points.z(x, y));
      const auto truth = points.status(x, y) == PixelStatus::ok ? to.project(point) : std::nullopt;
      if (truth && to.sees(*truth)) ++r.should_match;
      if (matches.status(x, y) != PixelStatus::ok) continue;
      ++r.matched;
      const double error = truth ? std::hypot(matches.u(x, y) - truth->x(), matches.v(x, y) - truth->y()) : 1e9;
      if (!(error < 1.5)) {
        ++r.wrong;
        continue;
      }
      r.rms_px += error * error;
      r.normalised_rms += std::pow(error / matches.sigma(x, y), 2);
    }
  r.rms_px = std::sqrt(r.rms_px / r.matched);
  r.normalised_rms = std::sqrt(r.normalised_rms / r.matched);
  return r;
}

class MatchSequences : public testing::Test {
 protected:
  const Rig rig = sim::make_test_rig(160);
  const Camera& cam1 = rig.cameras[0];
  const Camera& cam2 = rig.cameras[1];

  Result match(const AnalyticScene& scene, const Pattern& pattern, int count, Exposure first, Exposure second,
               const MatchOptions& options = {}) const {
    const Frames frames1 = expose(scene, cam1, pattern, count, first, 1);
    const Frames frames2 = expose(scene, cam2, pattern, count, second, 2);
    const MatchPair pair = match_sequences(frames1, frames2, cam1, cam2, options);
    return compare(pair.from_first, scene, cam1, cam2);
  }
};

TEST_F(MatchSequences, ReadsAGrayCode) {
  const Result r = match(cylinder, gray_code, 12, {}, {});
  EXPECT_GT(r.matched, 0.95 * r.should_match);
  EXPECT_LT(r.wrong, 0.001 * r.matched);
  EXPECT_LT(r.rms_px, 0.08);
  // Edges two pixels wide are more than any interpolation between pixels can follow; sigma knows most of it.
  EXPECT_GT(r.normalised_rms, 0.5);
  EXPECT_LT(r.normalised_rms, 2);
}

TEST_F(MatchSequences, ReadsRandomPatterns) {
  const Result r = match(cylinder, random_waves, 16, {}, {});
  EXPECT_GT(r.matched, 0.95 * r.should_match);
  EXPECT_EQ(r.wrong, 0);
  EXPECT_LT(r.rms_px, 0.06);
  EXPECT_LT(r.normalised_rms, 1.2);
}

TEST_F(MatchSequences, ReadsTheSweepingStripe) {
  // A third of a frame a pixel is little change beside the noise: where the stripe enters and leaves, too little.
  const Result r = match(cylinder, sweep, 44, {}, {});
  EXPECT_GT(r.matched, 0.8 * r.should_match);
  EXPECT_LT(r.wrong, 0.0005 * r.matched);
  EXPECT_LT(r.rms_px, 0.12);
  EXPECT_LT(r.normalised_rms, 1.2);
}

TEST_F(MatchSequences, EquationOneAsItStandsServesEqualCameras) {
  MatchOptions options;
  options.normalisation = Normalisation::none;
  options.interpolation = Interpolation::linear;
  const Result r = match(cylinder, random_waves, 16, {}, {}, options);
  EXPECT_GT(r.matched, 0.95 * r.should_match);
  EXPECT_EQ(r.wrong, 0);
  EXPECT_LT(r.rms_px, 0.06);
}

TEST_F(MatchSequences, AffineForgivesAnotherGainAndBlackLevel) {
  const Exposure dim{90, 2, 1.5}, bright{180, 30, 1.5};
  const Result r = match(cylinder, random_waves, 16, dim, bright);
  EXPECT_GT(r.matched, 0.95 * r.should_match);
  EXPECT_EQ(r.wrong, 0);
  EXPECT_LT(r.rms_px, 0.09);  // half the light in one camera
}

TEST_F(MatchSequences, ClippedPlateausStillMatch) {
  const Exposure over{420, 2, 1.5};
  const Result r = match(cylinder, gray_code, 12, over, over);
  EXPECT_GT(r.matched, 0.9 * r.should_match);
  EXPECT_LT(r.wrong, 0.002 * r.matched);
  EXPECT_LT(r.rms_px, 0.15);
}

TEST_F(MatchSequences, DroppedFramesOfEitherCameraAreLeftOut) {
  const Frames all1 = expose(cylinder, cam1, random_waves, 16, {}, 1);
  const Frames all2 = expose(cylinder, cam2, random_waves, 16, {}, 2);
  Frames frames1(all1.sequence()), frames2(all2.sequence());
  for (int i = 0; i < 16; ++i) {
    if (i != 3) frames1.set(i, all1.frame(i));
    if (i != 3 && i != 9) frames2.set(i, all2.frame(i));
  }
  const MatchPair pair = match_sequences(frames1, frames2, cam1, cam2);
  const Result r = compare(pair.from_first, cylinder, cam1, cam2);
  EXPECT_GT(r.matched, 0.95 * r.should_match);
  EXPECT_EQ(r.wrong, 0);
}

TEST_F(MatchSequences, AStepLeavesNoFalseMatches) {
  const Result r = match(step, random_waves, 16, {}, {});
  EXPECT_GT(r.matched, 0.93 * r.should_match);  // `should_match` also counts what the upper plate hides
  // Beside the edge a pixel's neighbours in the other picture belong to two surfaces: a mixture may look like neither
  // and fit by chance.
  EXPECT_LT(r.wrong, 0.001 * r.matched);
}

TEST_F(MatchSequences, SaysWhyAPixelHasNoMatch) {
  const auto half_lit = [](int i, double x, double y) { return x < 0 ? random_waves(i, x, y) : 0.01; };
  Frames frames1 = expose(cylinder, cam1, half_lit, 8, {}, 1);
  const Frames frames2 = expose(cylinder, cam2, half_lit, 8, {}, 2);
  for (int i = 0; i < 8; ++i) {
    auto image = std::get<Image<std::uint8_t>>(frames1.frame(i));
    image(50, 80) = 255;                                          // never below saturation
    image(52, 80) = static_cast<std::uint8_t>(i % 2 ? 220 : 20);  // like nothing else
    frames1.set(i, image);
  }
  const Correspondences matches = match_sequences(frames1, frames2, cam1, cam2).from_first;
  EXPECT_EQ(matches.status(120, 80), PixelStatus::too_dark);
  EXPECT_EQ(matches.status(50, 80), PixelStatus::saturated);
  EXPECT_EQ(matches.status(52, 80), PixelStatus::no_match);
  EXPECT_TRUE(std::isnan(matches.u(52, 80)));
}

TEST_F(MatchSequences, ARepeatedPatternIsAmbiguous) {
  const auto grating = [](int i, double, double y) { return 0.5 + 0.5 * std::sin(2 * M_PI * (y / 15 + i / 8.0)); };
  MatchOptions options;
  options.near_mm = 400;
  options.far_mm = 1000;
  const Frames frames1 = expose(cylinder, cam1, grating, 8, {}, 1), frames2 = expose(cylinder, cam2, grating, 8, {}, 2);
  const Correspondences matches = match_sequences(frames1, frames2, cam1, cam2, options).from_first;
  EXPECT_EQ(matches.status(80, 80), PixelStatus::ambiguous);
}

/// The second way begins where the first one ended, which must not hide that there are two places to begin at.
TEST_F(MatchSequences, WhatIsRepeatedOnceIsAmbiguousOnBothWays) {
  const auto repeated = [](int i, double x, double y) { return random_waves(i, x, y > 15 && y < 35 ? y - 50 : y); };
  MatchOptions options;
  options.near_mm = 400;
  options.far_mm = 1000;
  const Frames frames1 = expose(cylinder, cam1, repeated, 16, {}, 1);
  const Frames frames2 = expose(cylinder, cam2, repeated, 16, {}, 2);
  const MatchPair pair = match_sequences(frames1, frames2, cam1, cam2, options);
  const auto count = [&](const Correspondences& matches, const Camera& camera) {
    const PointMap points = cylinder.points(camera);
    std::array<int, 2> in_strips{}, matched{};
    for (int y = 0; y < camera.height; ++y)
      for (int x = 0; x < camera.width; ++x) {
        const double from_middle = std::abs(std::abs(points.y(x, y)) - 25);  // of the two strips
        if (!(from_middle < 6 || (from_middle > 14 && std::abs(points.y(x, y)) < 80))) continue;
        const std::size_t k = from_middle < 6 ? 0 : 1;
        ++in_strips[k];
        matched[k] += matches.status(x, y) == PixelStatus::ok ? 1 : 0;
      }
    EXPECT_GT(in_strips[0], 1000);
    EXPECT_LT(matched[0], 0.02 * in_strips[0]);  // noise may make one of two places the better one
    EXPECT_GT(matched[1], 0.9 * in_strips[1]);
  };
  count(pair.from_first, cam1);
  count(pair.from_second, cam2);
}

TEST_F(MatchSequences, CamerasMayBeTurned) {
  // By a quarter curves run along the rows, by an eighth neither along rows nor columns.
  for (const auto& [first, second] : {std::pair(M_PI / 2, 0.0), std::pair(0.0, M_PI / 4)}) {
    SCOPED_TRACE(testing::Message() << first << ' ' << second);
    Rig turned = rig;
    const auto turn = [](Camera& camera, double angle) {
      const Eigen::AngleAxisd rotation(angle, Eigen::Vector3d::UnitZ());
      camera.cam_from_rig = Rigid3(rotation.toRotationMatrix(), Eigen::Vector3d::Zero()) * camera.cam_from_rig;
    };
    turn(turned.cameras[0], first);
    turn(turned.cameras[1], second);
    const Frames frames1 = expose(cylinder, turned.cameras[0], random_waves, 16, {}, 1);
    const Frames frames2 = expose(cylinder, turned.cameras[1], random_waves, 16, {}, 2);
    const MatchPair pair = match_sequences(frames1, frames2, turned.cameras[0], turned.cameras[1]);
    const Result r = compare(pair.from_first, cylinder, turned.cameras[0], turned.cameras[1]);
    EXPECT_GT(r.matched, 0.95 * r.should_match);
    EXPECT_EQ(r.wrong, 0);
    EXPECT_LT(r.rms_px, 0.06);
    EXPECT_LT(r.normalised_rms, 1.2);
  }
}

TEST_F(MatchSequences, RefusesTooFewFramesAndWrongSizes) {
  const Frames two = expose(cylinder, cam1, random_waves, 2, {}, 1);
  EXPECT_THROW(match_sequences(two, two, cam1, cam2), Error);
  Frames other({"cam2", 20, 20, 4, 8, 0, 255});
  EXPECT_THROW(match_sequences(two, other, cam1, cam2), std::invalid_argument);
}

}  // namespace
}  // namespace pagesweep
