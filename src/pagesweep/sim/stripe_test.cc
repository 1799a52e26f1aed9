// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/stripe.h"

#include <gtest/gtest.h>

#include <cmath>

namespace pagesweep::sim {
namespace {

TEST(Stripe, HasItsWidthItsPeakAndItsMiddle) {
  for (const StripeShape shape : {StripeShape::gaussian, StripeShape::flat_top, StripeShape::skewed})
    for (const double softness : {0.3, 1.0}) {
      const Stripe stripe(shape, 12, softness);
      double sum = 0, moment = 0, peak = 0, above_half = 0;
      const double step = 0.01;
      for (double x = stripe.first_mm(); x < stripe.last_mm(); x += step) {
        const double light = double(stripe.light(float(x)));
        sum += light;
        moment += x * light;
        peak = std::max(peak, light);
        if (light > 0.5) above_half += step;
      }
      EXPECT_NEAR(above_half, 12, 0.03) << name_of(shape);
      EXPECT_NEAR(peak, 1, 1e-4) << name_of(shape);
      EXPECT_NEAR(moment / sum, 0, 0.01) << name_of(shape);
      EXPECT_EQ(stripe.light(float(stripe.last_mm() + 0.1)), 0);
      EXPECT_EQ(stripe.light(float(stripe.first_mm() - 0.1)), 0);
    }
}

TEST(Stripe, RisesFasterThanItFallsIfSkewed) {
  const Stripe stripe(StripeShape::skewed, 12, 1);
  EXPECT_GT(stripe.light(15), 2 * stripe.light(-15));
}

}  // namespace
}  // namespace pagesweep::sim
