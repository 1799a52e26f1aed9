// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/stripe.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

namespace pagesweep::sim {
namespace {

using Shape = std::function<double(double)>;

double normal_cumulative(double z) { return 0.5 * std::erfc(-z * std::numbers::sqrt2 / 2); }

/// The shape in units of its own, and how far it reaches.
struct UnitShape {
  Shape light;
  double reach;
};

UnitShape unit_shape(StripeShape shape, double softness) {
  switch (shape) {
    case StripeShape::flat_top: {
      const double sigma = 0.5 * softness;
      return {[=](double x) { return normal_cumulative((x + 1) / sigma) - normal_cumulative((x - 1) / sigma); },
              1 + 5 * sigma};
    }
    case StripeShape::skewed: {
      const double rate = 1 / softness;  // exponentially modified Gaussian of sigma 1, its mean moved to 0
      return {[=](double x) {
                const double late = x + softness;
                return std::exp(rate * (0.5 * rate - late)) * normal_cumulative(late - rate);
              },
              5 + 12 * softness};
    }
    default:
      return {[](double x) { return std::exp(-0.5 * x * x); }, 5};
  }
}

/// Where, between a place inside and one outside the stripe, the light falls through `level`.
double crossing(const Shape& light, double level, double inside, double outside) {
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (inside + outside);
    (light(middle) > level ? inside : outside) = middle;
  }
  return inside;
}

}  // namespace

Stripe::Stripe(StripeShape shape, double fwhm_mm, double softness) : samples_(cells + 1) {
  const UnitShape unit = unit_shape(shape, softness);
  double peak = 0, peak_light = 0;
  for (int i = -2000; i <= 2000; ++i) {
    const double x = unit.reach * i / 2000;
    if (unit.light(x) > peak_light) peak_light = unit.light(peak = x);
  }
  const double half = 0.5 * peak_light;
  const double width = crossing(unit.light, half, peak, unit.reach) - crossing(unit.light, half, peak, -unit.reach);
  const double mm_per_unit = fwhm_mm / width;
  first_mm_ = -unit.reach * mm_per_unit;
  samples_per_mm_ = cells / (-2 * first_mm_);
  // What is left at the ends is taken off everywhere, so that the light ends without a step.
  const double rest = std::max(unit.light(-unit.reach), unit.light(unit.reach));
  for (int i = 0; i <= cells; ++i) {
    const double light = unit.light(unit.reach * (2.0 * i / cells - 1));
    samples_[static_cast<std::size_t>(i)] = static_cast<float>(std::max(0.0, (light - rest) / (peak_light - rest)));
  }
}

}  // namespace pagesweep::sim
