// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/sequence_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pagesweep {
namespace {

constexpr std::size_t crossings = PlaceBatch::crossings;

CrossingWeights weights_of(const SequenceFit& fit) {
  return fit.is_cubic ? cubic_weights(fit.share) : linear_weights(fit.share);
}

}  // namespace

SequenceFitter::SequenceFitter(const SequenceStore& from, const SequenceStore& to, const MatchOptions& options)
    : from_(from),
      to_(to),
      to_arrays_(to.arrays()),
      options_(options),
      affine_(options.normalisation == Normalisation::affine) {
  batch_.samples = from.samples();
  batch_.freedom = std::max(1.0, from.samples() - (affine_ ? 3.0 : 1.0));
}

void SequenceFitter::fit(std::span<SequenceFit> fits) {
  constexpr int most_moves = 6;
  waiting_.clear();
  for (SequenceFit& fit : fits) waiting_.push_back(&fit);
  for (int move = 0; move < most_moves && !waiting_.empty(); ++move) {
    moved_.clear();
    for (std::size_t first = 0; first < waiting_.size(); first += PlaceBatch::most) {
      const std::size_t count = std::min<std::size_t>(PlaceBatch::most, waiting_.size() - first);
      const auto some = std::span(waiting_).subspan(first, count);
      for (auto& usable : batch_.usable) usable.fill(0);
      batch_.count = count;
      for (std::size_t lane = 0; lane < count; ++lane) load(*some[lane], lane);
      find_nearest_places(batch_, options_.normalisation, options_.interpolation);
      for (std::size_t lane = 0; lane < count; ++lane)
        if (take(lane, *some[lane])) moved_.push_back(some[lane]);
    }
    waiting_.swap(moved_);
  }
}

/// Enters the products of a pixel's sequence and those around its place.
void SequenceFitter::load(SequenceFit& fit, std::size_t lane) {
  if (fit.moved == 0 && !place_crossings(fit)) return;
  interpolate(fit, lane);
  const CrossingProducts products = multiply(fit.crossings.data(), from_.sequence(fit.x, fit.y), to_arrays_.length);
  batch_.gg[lane] = products.gg;
  for (std::size_t i = 0; i < crossings; ++i) {
    batch_.gs[i][lane] = products.gs[i];
    for (std::size_t j = i; j < crossings; ++j) batch_.ss[i][j][lane] = products.ss[i][j];
  }
}

/// The curve's tangent at a place, and where it crosses the grid around. Over three pixels no lens bends the curve by
/// more than a thousandth of a pixel.
bool SequenceFitter::place_crossings(SequenceFit& fit) const {
  const auto here = fit.curve->tangent(fit.inverse_depth);
  if (!here) return false;
  fit.along_rows = std::abs(here->change.x()) >= std::abs(here->change.y());
  const int main = fit.along_rows ? 0 : 1;
  if (here->change[main] == 0) return false;
  fit.step = 1 / here->change[main];
  fit.slope = here->change[1 - main] * fit.step;
  fit.first = static_cast<int>(std::floor(here->pixel[main])) - 1;
  const double back = fit.first - here->pixel[main];
  fit.at_first = here->pixel[1 - main] + back * fit.slope;
  fit.depth_at_first = fit.inverse_depth + back * fit.step;
  return true;
}

/// The sequences at the crossings, where the pixels beside them have some.
void SequenceFitter::interpolate(SequenceFit& fit, std::size_t lane) {
  constexpr double one_share = 32768;  // see Crossing
  const int width = to_.width(), height = to_.height();
  const int length = fit.along_rows ? width : height, breadth = fit.along_rows ? height : width;
  const int step = fit.along_rows ? 1 : width, step_across = fit.along_rows ? width : 1;
  const double last = breadth - 1;
  double position = fit.at_first;
  for (std::size_t k = 0; k < crossings; ++k, position += fit.slope) {
    const double across = std::min(std::max(position, 0.0), last);
    const int main = fit.first + static_cast<int>(k), low = static_cast<int>(across);
    const double share = across - low;
    const std::int32_t pixel = main * step + low * step_across;
    const std::int32_t next = low < breadth - 1 ? pixel + step_across : pixel;
    const bool usable =
        main >= 0 && main < length && to_.status(pixel) == PixelStatus::ok && to_.status(next) == PixelStatus::ok;
    fit.crossed[k] = usable ? pixel : to_arrays_.nowhere();
    fit.crossings[k] = {to_arrays_.sequence(fit.crossed[k]), to_arrays_.sequence(usable ? next : fit.crossed[k]),
                        static_cast<std::int16_t>(std::min(one_share * share + 0.5, one_share - 1))};
    fit.noise_share[k] = (1 - share) * (1 - share) + share * share;
    batch_.noise_share[k][lane] = fit.noise_share[k];
    batch_.usable[k][lane] = usable ? 1 : 0;
  }
}

/// \return whether the least lies beyond the crossings, which were moved
bool SequenceFitter::take(std::size_t lane, SequenceFit& fit) const {
  fit.share = batch_.share[lane];
  if (std::isnan(fit.share)) return false;
  const int direction = fit.share <= 0 ? -1 : fit.share >= 1 ? 1 : 0;
  // A least between two segments, at the crossing itself, is where it is.
  if (direction != 0 && direction != -fit.moved) {
    if (!(batch_.usable[direction < 0 ? 0 : crossings - 1][lane] > 0)) return false;
    fit.moved = direction;
    fit.first += direction;
    fit.at_first += direction * fit.slope;
    fit.depth_at_first += direction * fit.step;
    return true;
  }
  const double place = 1 + fit.share, along = fit.first + place, across = fit.at_first + place * fit.slope;
  fit.inverse_depth = fit.depth_at_first + place * fit.step;
  fit.pixel = fit.along_rows ? Eigen::Vector2d(along, across) : Eigen::Vector2d(across, along);
  fit.distance_squared = batch_.distance_squared[lane];
  fit.is_cubic = batch_.is_cubic[lane] > 0;
  fit.gain = batch_.gain[lane];
  fit.doubt = batch_.doubt[lane];
  fit.noise_variance = batch_.noise_variance[lane];
  const CrossingWeights weights = weights_of(fit);
  double change = 0;
  for (std::size_t k = 0; k < crossings; ++k) change += weights.change[k] * batch_.gs[k][lane];
  fit.change_along_own = fit.gain * change / batch_.gg[lane];
  fit.found = true;
  return false;
}

/// Residuals r and changes d of the frames give the standard deviation twice: as in any least squares,
/// sqrt(mean r^2 / sum d^2), and without the belief that residuals are alike in all frames, sqrt(sum r^2 d^2) / sum
/// d^2. The second is larger where the sequences differ just where they change, as beside clipped stripes; the larger
/// one counts.
double SequenceFitter::sigma_px(const SequenceFit& fit) const {
  const CrossingWeights weights = weights_of(fit);
  Mixture mixture{fit.crossings.data(), {}, {}, 0};
  double rounding_variance = from_.rounding_variance(fit.x, fit.y), change_noise = 0;
  for (std::size_t k = 0; k < crossings; ++k) {
    const double value = fit.gain * weights.value[k], change = fit.gain * weights.change[k];
    mixture.value[k] = static_cast<float>(value);
    mixture.change[k] = static_cast<float>(change);
    if (fit.crossed[k] == to_arrays_.nowhere()) continue;
    rounding_variance += value * value * fit.noise_share[k] * to_.rounding_variance(fit.crossed[k]);
    change_noise += change * change * fit.noise_share[k];
  }
  // What a change of gain would do just as well is no change.
  if (affine_) mixture.change_of_own = static_cast<float>(-fit.change_along_own);
  const ResidualSums sums = sum_residuals(mixture, from_.sequence(fit.x, fit.y), to_arrays_.length);
  // Rounding is there even where clipping hides all other noise.
  const double noise = sums.rr / batch_.freedom + rounding_variance;
  const double weighted = sums.rrdd * batch_.samples / batch_.freedom;
  // Noise of the crossings looks like change; only what exceeds it, and its chi-squared scatter, is known to be change.
  const double noise_energy = fit.noise_variance * change_noise * batch_.samples;
  const double change_squared = sums.dd - noise_energy * (1 + 3 * std::sqrt(2 / batch_.samples));
  if (!(change_squared > 0)) return std::numeric_limits<double>::infinity();
  const double variance = std::max(noise, weighted / change_squared) / change_squared;  // [crossings^2]
  return std::sqrt((1 + fit.slope * fit.slope) * (variance + fit.doubt * fit.doubt));
}

}  // namespace pagesweep
