// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/stripe_search_internal.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pagesweep {
namespace {

bool is_dropped(const Image<float>& samples, int i) { return samples.width() > 0 && std::isnan(samples(0, i)); }

}  // namespace

StripeSearch::StripeSearch(double fwhm)
    : box_(2 * std::max(1, static_cast<int>(std::lround(0.5 * fwhm))) + 1),
      distance_(std::max(box_, static_cast<int>(std::lround(1.4 * fwhm)))) {}

double StripeSearch::rise_sigma(const FrameNoise& noise) const {
  return std::sqrt(1.5 * noise.sensor().read_variance / (box_ * noise.mean_weight()));
}

void StripeSearch::find(const Image<float>& samples, const FrameNoise& noise, bool clipped) {
  const auto width = static_cast<std::size_t>(samples.width());
  frame_.assign(width, 0);
  rise_.assign(width, -std::numeric_limits<float>::infinity());
  // Where exposures take turns, neighbouring frames do not stand for each other.
  stride_ = noise.mean_weight() < 1 ? 1 : std::max(1, box_ / 4);
  accumulate(samples, noise);
  filter();
  look_between(noise);
  if (clipped) centre_clipped(samples, noise);
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
      add_weighted(sums_.row(i), samples.row(shown), weight, static_cast<float>(noise.at(shown).ceiling),
                   sums_.row(i + 1));
  }
}

MeanOfFrames StripeSearch::box_around(int centre) const {
  const int count = sums_.height() - 1, half = box_ / 2;
  const int begin = std::clamp(centre - half, 0, count), end = std::clamp(centre + half + 1, 0, count);
  const float weight = weights_[static_cast<std::size_t>(end)] - weights_[static_cast<std::size_t>(begin)];
  return {sums_.row(begin).data(), sums_.row(end).data(), end > begin ? 1.0F / weight : 0.0F};
}

/// The box at frame i and, to be taken off, those beside it.
std::array<MeanOfFrames, 3> StripeSearch::boxes_at(int i) const {
  std::array<MeanOfFrames, 3> boxes{box_around(i), box_around(i - distance_), box_around(i + distance_)};
  // Beyond the recording's ends a box is cut; where nothing of it is left, the other side's stands for both.
  if (boxes[1].factor > 0 && boxes[2].factor > 0) boxes[1].factor *= 0.5F, boxes[2].factor *= 0.5F;
  return boxes;
}

void StripeSearch::filter() {
  for (int i = 0; i + 1 < sums_.height(); i += stride_) {
    const auto [middle, left, right] = boxes_at(i);
    keep_highest(middle, left, right, i, rise_, frame_);
  }
}

/// Faint bells need the highest response of all frames to rise from the noise.
void StripeSearch::look_between(const FrameNoise& noise) {
  const auto sigma = static_cast<float>(rise_sigma(noise));
  const int last = sums_.height() - 2;
  for (std::size_t x = 0; x < rise_.size(); ++x) {
    if (!(rise_[x] > 2.5F * sigma && rise_[x] < 15 * sigma)) continue;
    const int found = frame_[x];
    for (int i = std::max(0, found - stride_ / 2); i <= std::min(last, found + stride_ / 2); ++i) {
      const auto [middle, left, right] = boxes_at(i);
      const float response = middle.of(x) - left.of(x) - right.of(x);
      if (!(response > rise_[x])) continue;
      rise_[x] = response;
      frame_[x] = i;
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
