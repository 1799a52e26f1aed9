// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "pagesweep/base/instruction_sets_testing.h"
#include "pagesweep/timing/bell_fit.h"
#include "pagesweep/timing/plain_bells_internal.h"
#include "pagesweep/timing/row_windows_internal.h"
#include "pagesweep/timing/stripe_pixel_testing.h"
#include "pagesweep/timing/stripe_width.h"

namespace pagesweep {
namespace {

/// A skewed stripe: what is symmetric hides errors of sign.
StripeProfile make_profile() {
  const auto shape = testing::skewed(2.5, 5);
  std::vector<StripeProfile::Point> points;
  for (double t = -25; t <= 25; t += 0.1) points.push_back({t, shape(t)});
  return StripeProfile::fit(points, -25, 25, 0.5);
}

/// Samples of `most_bells` noisy pixels, and the fits of both ways.
class PlainBellsTest : public ::testing::Test {
 protected:
  static constexpr int count = 160;
  const StripeProfile profile = make_profile();
  const SensorNoise noise{.read_variance = 1.5, .gain = 0.03, .ceiling = 60};
  const double reach = reach_around(profile);
  BellTables tables{profile, reach};
  PlainBells bells{tables, noise, profile.full_width_half_maximum()};
  std::vector<std::vector<float>> gray;
  std::vector<float> present;
  std::vector<Bell> truth;

  /// \param middle  [frames] about where the bells are
  void make(double middle, int missing_every = 0) {
    tables.cover({0.9, 1.15});
    present.assign(3 * count, 0.0F);  // frame i is entry count + i
    for (int i = 0; i < count; ++i)
      present[static_cast<std::size_t>(count + i)] = missing_every > 0 && i % missing_every == 0 ? 0.0F : 1.0F;
    for (int p = 0; p < most_bells; ++p) {
      truth.push_back({20.0 + 12 * p, 3.0 + p, middle + 0.37 * p - 3, 0.92 + 0.013 * p});
      std::vector<float> samples(3 * count, 0.0F);
      for (int i = 0; i < count; ++i) {
        const double light = truth.back().gray_at(i, profile);
        const auto place = static_cast<std::uint64_t>(1000 * p + i);
        const double scatter = std::sqrt(noise.variance(light)) * testing::normal(11, place);
        samples[static_cast<std::size_t>(count + i)] = static_cast<float>(light + scatter);
      }
      gray.push_back(samples);
    }
  }
  int expected(int p) const { return static_cast<int>(std::lround(truth[static_cast<std::size_t>(p)].time + 0.9)); }

  void add(int p, float log_width) {
    const auto first = static_cast<std::size_t>(count + expected(p) - bells.reach());
    bells.add(expected(p), bells.table(log_width), log_width, &gray[static_cast<std::size_t>(p)][first],
              &present[first]);
  }
  void fit(bool partial) {
    bells.clear();
    for (int p = 0; p < most_bells; ++p) add(p, static_cast<float>(std::log(truth[static_cast<std::size_t>(p)].width)));
    bells.fit(partial ? Content::partial : Content::whole);
  }

  /// Clips all samples above the noise's ceiling; amplitudes are 20 to 200. \return how many of each pixel
  std::array<int, most_bells> clip() {
    std::array<int, most_bells> clipped{};
    for (std::size_t p = 0; p < most_bells; ++p)
      for (float& sample : gray[p])
        if (static_cast<double>(sample) > noise.ceiling) {
          sample = std::numeric_limits<float>::infinity();
          ++clipped[p];
        }
    return clipped;
  }

  /// The scalar way, over the samples that the vectors' last step saw.
  BellFit fit_alone(int p, int frames_around, const Bell& start, BellUnknowns unknowns = BellUnknowns::basic) const {
    const auto& samples = gray[static_cast<std::size_t>(p)];
    const int begin = static_cast<int>(std::lround(bells[p].time)) - frames_around;
    const int end = 2 * static_cast<int>(std::lround(bells[p].time)) - begin;
    std::vector<float> window;
    for (int i = begin; i <= end; ++i) {
      const auto k = static_cast<std::size_t>(count + i);
      window.push_back(present[k] > 0 ? samples[k] : std::numeric_limits<float>::quiet_NaN());
    }
    return fit_bell(window, begin, profile, noise, start, {.unknowns = unknowns});
  }

  void expect_agreement() const {
    for (int p = 0; p < most_bells; ++p) {
      SCOPED_TRACE(p);
      const PlainBells::Fit fast = bells[p];
      const Bell& bell = truth[static_cast<std::size_t>(p)];
      const BellFit slow = fit_alone(p, bells.table(std::log(bell.width)).reach, bell);
      ASSERT_TRUE(fast.converged);
      ASSERT_TRUE(slow.converged);
      EXPECT_NEAR(fast.time, slow.bell.time, 0.05 * slow.time_sigma());
      EXPECT_NEAR(fast.time_sigma, slow.time_sigma(), 0.02 * slow.time_sigma());
      EXPECT_NEAR(fast.amplitude, slow.bell.amplitude, 0.05 * std::sqrt(slow.covariance(0, 0)));
      EXPECT_NEAR(fast.background, slow.bell.background, 0.05 * std::sqrt(slow.covariance(1, 1)));
      EXPECT_NEAR(fast.chi_square, slow.chi_square, 0.02 * slow.chi_square);
      EXPECT_EQ(fast.samples, slow.samples);
    }
  }
};

TEST_F(PlainBellsTest, AgreesWithTheScalarFitOnEveryInstructionSet) {
  make(80);
  on_every_instruction_set([&] {
    fit(false);
    expect_agreement();
  });
}

TEST_F(PlainBellsTest, WidthsAgreeWithTheScalarFitOnEveryInstructionSet) {
  make(80, 11);
  tables.cover({1 / widest_stripe, widest_stripe});
  on_every_instruction_set([&] {
    // The second time, the first step already sees the samples that the last one sees.
    std::array<float, most_bells> widths{};
    for (int round = 0; round < 2; ++round) {
      bells.clear();
      for (int p = 0; p < most_bells; ++p) add(p, widths[static_cast<std::size_t>(p)]);
      bells.fit_widths(Content::partial);
      for (int p = 0; p < most_bells; ++p) widths[static_cast<std::size_t>(p)] = static_cast<float>(bells[p].log_width);
    }
    for (int p = 0; p < most_bells; ++p) {
      SCOPED_TRACE(p);
      Bell start = truth[static_cast<std::size_t>(p)];
      start.width = 1;
      const int reach_here = bells.table(bells[p].log_width).reach;
      const BellFit slow = fit_alone(p, reach_here, start, BellUnknowns::width);
      ASSERT_TRUE(bells[p].converged);
      ASSERT_TRUE(slow.converged);
      EXPECT_NEAR(bells[p].log_width, std::log(slow.bell.width), 0.1 * slow.log_width_sigma());
      EXPECT_NEAR(bells[p].log_width_sigma, slow.log_width_sigma(), 0.05 * slow.log_width_sigma());
      // A bell between two frames may have been moved on by the last step, and lose one sample of noise for another.
      EXPECT_NEAR(bells[p].chi_square, slow.chi_square, 9);
    }
  });
}

TEST_F(PlainBellsTest, AgreesWhereFramesWereDropped) {
  make(80, 7);
  fit(true);
  expect_agreement();
}

TEST_F(PlainBellsTest, ClippedBellsAgreeWithTheScalarFitOnEveryInstructionSet) {
  make(80);
  const auto clipped = clip();
  ASSERT_EQ(clipped.front(), 0);
  ASSERT_GT(clipped.back(), 10);
  on_every_instruction_set([&] {
    bells.clear();
    for (int p = 0; p < most_bells; ++p) {
      add(p, static_cast<float>(std::log(truth[static_cast<std::size_t>(p)].width)));
      bells.start_at(static_cast<float>(p % 3 - 1));
    }
    bells.fit(Content::clipped);
    for (int p = 0; p < most_bells; ++p) {
      SCOPED_TRACE(p);
      const Bell& bell = truth[static_cast<std::size_t>(p)];
      const BellFit slow = fit_alone(p, bells.table(std::log(bell.width)).reach, bell);
      ASSERT_TRUE(bells[p].converged);
      ASSERT_TRUE(slow.converged);
      EXPECT_NEAR(bells[p].time, slow.bell.time, 0.1 * slow.time_sigma());
      EXPECT_NEAR(bells[p].time_sigma, slow.time_sigma(), 0.02 * slow.time_sigma());
      EXPECT_NEAR(bells[p].amplitude, slow.bell.amplitude, 0.1 * std::sqrt(slow.covariance(0, 0)));
      // The last step takes no more than what it is small enough for.
      EXPECT_NEAR(bells[p].chi_square, slow.chi_square, 0.02 * slow.chi_square);
      EXPECT_EQ(bells[p].samples, slow.samples);
    }
  });
}

TEST_F(PlainBellsTest, CoresOnCurvedBackgroundsAgreeWithTheScalarFitOnEveryInstructionSet) {
  make(80);
  // Light from elsewhere, as much as a third of the brightest bell and more than the darkest.
  for (int p = 0; p < most_bells; ++p)
    for (int i = 0; i < count; ++i) {
      const double after = (i - truth[static_cast<std::size_t>(p)].time - 15) / 12;
      gray[static_cast<std::size_t>(p)][static_cast<std::size_t>(count + i)] +=
          static_cast<float>(60 * std::exp(-0.5 * after * after));
    }
  const double fwhm = profile.full_width_half_maximum();
  on_every_instruction_set([&] {
    bells.clear();
    for (int p = 0; p < most_bells; ++p) {
      const Bell& bell = truth[static_cast<std::size_t>(p)];
      add(p, static_cast<float>(std::log(bell.width)));
      PlainBells::Fit start;
      start.time = bell.time + 0.4;
      start.amplitude = 1.2 * bell.amplitude;
      start.background = bell.background;
      bells.start_at(start);
    }
    bells.fit_on_curved();
    for (int p = 0; p < most_bells; ++p) {
      SCOPED_TRACE(p);
      Bell start = truth[static_cast<std::size_t>(p)];
      start.time += 0.4;
      const double core = core_widths * fwhm * start.width;
      const int begin = static_cast<int>(std::ceil(start.time - core));
      const int end = static_cast<int>(std::floor(start.time + core)) + 1;
      const BellFit slow =
          fit_bell(std::span(gray[static_cast<std::size_t>(p)])
                       .subspan(static_cast<std::size_t>(count + begin), static_cast<std::size_t>(end - begin)),
                   begin, profile, noise, start, {.unknowns = BellUnknowns::curved_background});
      ASSERT_TRUE(bells[p].converged);
      ASSERT_TRUE(slow.converged);
      EXPECT_NEAR(bells[p].time, slow.bell.time, 0.1 * slow.time_sigma());
      EXPECT_NEAR(bells[p].time_sigma, slow.time_sigma(), 0.03 * slow.time_sigma());
      EXPECT_NEAR(bells[p].amplitude, slow.bell.amplitude, 0.1 * std::sqrt(slow.covariance(0, 0)));
      EXPECT_NEAR(bells[p].slope, slow.bell.slope, 0.1 * std::sqrt(slow.covariance(3, 3)));
      EXPECT_NEAR(bells[p].curvature, slow.bell.curvature, 0.1 * std::sqrt(slow.covariance(4, 4)));
      EXPECT_NEAR(bells[p].chi_square, slow.chi_square, 0.02 * slow.chi_square);
      EXPECT_EQ(bells[p].samples, slow.samples);
    }
  });
}

TEST_F(PlainBellsTest, AgreesAtTheEndsOfTheRecording) {
  for (const double middle : {12.0, count - 12.0}) {
    gray.clear();
    truth.clear();
    make(middle);
    fit(true);
    expect_agreement();
  }
}

TEST_F(PlainBellsTest, ABellThatIsElsewhereIsNoPlainCase) {
  make(80);
  bells.clear();
  const auto first = static_cast<std::size_t>(count + 30 - bells.reach());
  bells.add(30, bells.table(0), 0, gray[15].data() + first,
            present.data() + first);  // 50 frames before it: nothing but noise
  bells.fit(Content::whole);
  EXPECT_TRUE(!bells[0].converged || bells[0].amplitude < 5 * std::sqrt(noise.read_variance));
}

}  // namespace
}  // namespace pagesweep
