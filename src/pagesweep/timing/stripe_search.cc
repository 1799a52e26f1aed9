// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/stripe_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace pagesweep {
namespace {

bool is_dropped(const Image<float>& samples, int i) { return samples.width() > 0 && std::isnan(samples(0, i)); }

/// sums = before + weight * the frame, clipped samples at the ceiling.
void add_frame(std::span<const float> before, std::span<const float> frame, float weight, float ceiling,
               std::span<float> sums) {
  for (std::size_t x = 0; x < frame.size(); ++x) sums[x] = before[x] + weight * std::min(frame[x], ceiling);
}

}  // namespace

StripeSearch::StripeSearch(double fwhm)
    : box_(2 * std::max(1, static_cast<int>(std::lround(0.5 * fwhm))) + 1),
      distance_(std::max(box_, static_cast<int>(std::lround(1.4 * fwhm)))) {}

double StripeSearch::rise_sigma(const FrameNoise& noise) const {
  return std::sqrt(1.5 * noise.sensor().read_variance / (box_ * noise.mean_weight()));
}

void StripeSearch::find(const Image<float>& samples, const FrameNoise& noise) {
  const auto width = static_cast<std::size_t>(samples.width());
  frame_.assign(width, 0);
  rise_.assign(width, -std::numeric_limits<float>::infinity());
  accumulate(samples, noise);
  filter();
  centre_clipped(samples, noise);
}

void StripeSearch::accumulate(const Image<float>& samples, const FrameNoise& noise) {
  if (sums_.width() != samples.width() || sums_.height() != samples.height() + 1)
    sums_ = Image<float>(samples.width(), samples.height() + 1);
  std::ranges::fill(sums_.row(0), 0.0F);
  weights_.assign(static_cast<std::size_t>(sums_.height()), 0.0F);
  for (int i = 0; i < samples.height(); ++i) {
    // A dropped frame repeats the one before: good enough to find a bell, and no estimator reads it.
    int shown = i;
    while (shown > 0 && is_dropped(samples, shown)) --shown;
    while (shown + 1 < samples.height() && is_dropped(samples, shown)) ++shown;
    const auto weight = static_cast<float>(noise.weight(shown));
    weights_[static_cast<std::size_t>(i) + 1] = weights_[static_cast<std::size_t>(i)] + weight;
    if (is_dropped(samples, shown))
      std::ranges::copy(sums_.row(i), sums_.row(i + 1).begin());
    else
      add_frame(sums_.row(i), samples.row(shown), weight, static_cast<float>(noise.at(shown).ceiling),
                sums_.row(i + 1));
  }
}

void StripeSearch::filter() {
  const int count = sums_.height() - 1, half = box_ / 2;
  // Beyond the recording's ends a box is cut; where nothing of it is left, the other side's stands for both.
  const auto mean_of = [&](int centre) {
    const int begin = std::clamp(centre - half, 0, count), end = std::clamp(centre + half + 1, 0, count);
    const float weight = weights_[static_cast<std::size_t>(end)] - weights_[static_cast<std::size_t>(begin)];
    return std::tuple{sums_.row(begin).data(), sums_.row(end).data(), end > begin ? 1.0F / weight : 0.0F};
  };
  for (int i = 0; i < count; ++i) {
    const auto [middle_begin, middle_end, middle] = mean_of(i);
    auto [left_begin, left_end, left] = mean_of(i - distance_);
    auto [right_begin, right_end, right] = mean_of(i + distance_);
    const bool both = left > 0 && right > 0;
    if (both) left *= 0.5F, right *= 0.5F;
    for (std::size_t x = 0; x < rise_.size(); ++x) {
      const float response = middle * (middle_end[x] - middle_begin[x]) - left * (left_end[x] - left_begin[x]) -
                             right * (right_end[x] - right_begin[x]);
      const bool higher = response > rise_[x];
      rise_[x] = higher ? response : rise_[x];
      frame_[x] = higher ? i : frame_[x];
    }
  }
}

void StripeSearch::centre_clipped(const Image<float>& samples, const FrameNoise& noise) {
  const int count = samples.height();
  const auto above = static_cast<float>(noise.sensor().ceiling + 0.5);
  for (int x = 0; x < samples.width(); ++x) {
    const auto index = static_cast<std::size_t>(x);
    // Within the plateau of a longer exposure, a shorter one has samples above it.
    const auto is_clipped = [&](int i) { return !(samples(x, i) < above); };
    int begin = std::max(0, frame_[index] - box_ / 2);
    const int stop = std::min(count, frame_[index] + box_ / 2 + 1);
    while (begin < stop && !std::isinf(samples(x, begin))) ++begin;
    if (begin == stop) continue;
    int end = begin;
    while (end < count && is_clipped(end)) ++end;
    while (begin > 0 && is_clipped(begin - 1)) --begin;
    frame_[index] = (begin + end - 1) / 2;
  }
}

}  // namespace pagesweep
