// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/planning/plan_time.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

namespace pagesweep {
namespace {

using std::numbers::pi;

constexpr double sigma_frames = 4;
const double stripe_mm = sigma_frames * 2 * std::sqrt(2 * std::numbers::ln2);  // at 1 mm/frame

/// Nothing but photon noise, nothing clipped.
RecordingPlan photons_only() {
  return {.full_well_electrons = 10000, .read_noise_electrons = 0, .bits = 16, .stripe_mm = stripe_mm};
}

TEST(PlanTime, OfAGaussianInPhotonNoiseIsTheTextbooks) {
  // sum (A p')^2 K / (A p) = A K sqrt(2 pi) / s: localising s / sqrt(N) with all N electrons of the bell. p' is odd and
  // p even, so that unknown amplitude and background cost nothing.
  const double electrons = 0.7 * 10000 * sigma_frames * std::sqrt(2 * pi);
  EXPECT_NEAR(std::sqrt(plan_time(photons_only(), 1).total()), sigma_frames / std::sqrt(electrons), 2e-5);
}

TEST(PlanTime, OfAGaussianInReadNoiseIsTheTextbooks) {
  RecordingPlan plan = photons_only();
  plan.full_well_electrons = 1e8;
  plan.read_noise_electrons = 1e6;
  const double expected = 1e6 / 0.7e8 * std::sqrt(2 * sigma_frames / std::sqrt(pi));
  EXPECT_NEAR(std::sqrt(plan_time(plan, 1).total()) / expected, 1, 2e-3) << "a little photon noise is left";
}

TEST(PlanTime, ItsSharesBelongToTheirNoise) {
  const RecordingPlan plan{.stripe_mm = stripe_mm};
  const TimeVariance all = plan_time(plan, 1);
  EXPECT_NEAR(all.total(), all.shot + all.read + all.rounding, 1e-15);
  RecordingPlan fine = plan;
  fine.bits = 14;
  const TimeVariance unrounded = plan_time(fine, 1);
  // Weights change with the noise, so that the shares are exact to first order only.
  EXPECT_NEAR(all.total() - unrounded.total(), all.rounding, 0.15 * all.rounding);
  EXPECT_GT(all.shot, all.read);
  EXPECT_GT(all.rounding, 0);
}

/// Maximum likelihood for (t, A, b) in known noise, by Gauss and Newton.
double fitted_time(const std::vector<double>& gray, double start, double amplitude, double shot, double constant) {
  Eigen::Vector3d fit(start, amplitude, 0);
  for (int step = 0; step < 6; ++step) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < gray.size(); ++i) {
      const double u = (static_cast<double>(i) - fit(0)) / sigma_frames, p = std::exp(-0.5 * u * u);
      const Eigen::Vector3d gradient(fit(1) * p * u / sigma_frames, p, 1);
      const double variance = shot * std::max(0.0, fit(1) * p) + constant;
      normal += gradient * gradient.transpose() / variance;
      right += gradient * (gray[i] - fit(1) * p - fit(2)) / variance;
    }
    fit += normal.inverse() * right;
  }
  return fit(0);
}

TEST(PlanTime, MaximumLikelihoodOnSimulatedPixelsReachesIt) {
  const RecordingPlan plan{.stripe_mm = stripe_mm};
  const double gray_per_electron = 255 / plan.full_well_electrons, amplitude = 0.7 * 255;
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> phase;
  double squares = 0;
  const int pixels = 6000;
  for (int n = 0; n < pixels; ++n) {
    const double t = 30 + phase(random);
    std::vector<double> gray(61);
    for (std::size_t i = 0; i < gray.size(); ++i) {
      const double u = (static_cast<double>(i) - t) / sigma_frames;
      const double electrons = 0.7 * plan.full_well_electrons * std::exp(-0.5 * u * u);
      const double counted = electrons > 0 ? std::poisson_distribution<int>(electrons)(random) : 0;
      gray[i] = std::round((counted + plan.read_noise_electrons * normal(random)) * gray_per_electron);
    }
    const double constant = std::pow(plan.read_noise_electrons * gray_per_electron, 2) + 1.0 / 12;
    squares += std::pow(fitted_time(gray, t, amplitude, gray_per_electron, constant) - t, 2);
  }
  // The standard deviation of an rms over 6000 is 0.9 %.
  EXPECT_NEAR(std::sqrt(squares / pixels / plan_time(plan, 1).total()), 1, 0.03);
}

TEST(PlanTime, ScalesAsTheNoiseDoes) {
  const auto sigma = [](const RecordingPlan& plan) { return std::sqrt(plan_time(plan, 1).total()); };
  RecordingPlan plan = photons_only();
  const double now = sigma(plan);
  plan.stripe_mm *= 2;
  EXPECT_NEAR(sigma(plan) / now, std::sqrt(2), 1e-3) << "sqrt(s) at the same peak";
  plan = photons_only();
  plan.amplitude /= 4;
  EXPECT_NEAR(sigma(plan) / now, 2, 2e-3) << "1 / sqrt(A)";
  plan = {.read_noise_electrons = 100, .bits = 8, .stripe_mm = stripe_mm};
  const double coarse = sigma(plan);
  plan.bits = 6;
  EXPECT_GT(sigma(plan), 1.05 * coarse) << "rounding to four times the step";
  plan.bits = 8;
  plan.exposure_frames = 1;
  EXPECT_GT(sigma(plan), coarse) << "the stripe moves on during the exposure";
  EXPECT_LT(sigma(plan), 1.01 * coarse) << "but a box of a frame widens a bell of sigma 4 by 0.3 %";
}

TEST(PlanTime, ClippingCostsWhatTheTopOfTheBellKnew) {
  RecordingPlan plan = photons_only();
  plan.amplitude = 0.999;
  const double full = plan_time(plan, 1).total();
  plan.amplitude = 1.3;
  const double clipped = plan_time(plan, 1).total();
  EXPECT_GT(clipped, full / 1.3) << "the light that is clipped says nothing";
  EXPECT_LT(clipped, 1.5 * full) << "the flanks are what tells";
  plan.amplitude = 2;
  EXPECT_TRUE(std::isfinite(plan_time(plan, 1).total()));
}

TEST(PlanTime, AStripeBetweenTheFramesTellsNothing) {
  RecordingPlan plan = photons_only();
  plan.stripe_mm = 0.1;
  EXPECT_FALSE(std::isfinite(plan_time(plan, 1).total()));
  const double best = best_stripe_mm(plan, 1);
  EXPECT_GT(best, 0.5);
  EXPECT_LT(best, 3);
  plan.stripe_mm = best;
  const double least = plan_time(plan, 1).total();
  for (const double factor : {0.8, 1.25}) {
    plan.stripe_mm = factor * best;
    EXPECT_GT(plan_time(plan, 1).total(), least);
  }
}

TEST(PlanTime, NamesTheOptionThatCannotBeMeant) {
  const auto complains_about = [](const RecordingPlan& plan, double speed, const char* option) {
    try {
      plan_time(plan, speed);
      ADD_FAILURE() << option << " passed";
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find(option), std::string::npos) << error.what();
    }
  };
  complains_about({.amplitude = 0}, 1, "--amplitude");
  complains_about({.amplitude = NAN}, 1, "--amplitude");
  complains_about({.full_well_electrons = 0}, 1, "--full-well");
  complains_about({.read_noise_electrons = -1}, 1, "--read-noise");
  complains_about({.bits = 17}, 1, "--bits");
  complains_about({.stripe_mm = 0}, 1, "--stripe-mm");
  complains_about({.stripe_mm = 1e9}, 1, "--stripe-mm");
  complains_about({.exposure_frames = 2}, 1, "--exposure");
  complains_about({}, 0, "--mm-per-frame");
  complains_about({}, NAN, "--mm-per-frame");
}

}  // namespace
}  // namespace pagesweep
