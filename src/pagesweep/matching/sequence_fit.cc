// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/sequence_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace pagesweep {
namespace {

constexpr std::size_t crossings = Crossings::count;

CrossingWeights weights_of(const SequenceFit& fit) {
  return fit.is_cubic ? cubic_weights(fit.share) : linear_weights(fit.share);
}

}  // namespace

SequenceFitter::SequenceFitter(const SequenceStore& from, const SequenceStore& to, const MatchOptions& options)
    : from_(from),
      to_(to),
      to_arrays_(to.arrays()),
      options_(options),
      width_(to_arrays_.along_rows ? to_arrays_.places : to_arrays_.lines),
      height_(to_arrays_.along_rows ? to_arrays_.lines : to_arrays_.places) {
  const bool affine = options.normalisation == Normalisation::affine;
  batch_.samples = from.samples();
  batch_.freedom = std::max(1.0, from.samples() - (affine ? 3.0 : 1.0));
  const auto pairs = static_cast<std::size_t>(to_arrays_.pairs);
  mixtures_.own.resize(pairs * MixtureBatch::most);
  mixtures_.crossings.resize(pairs * MixtureBatch::most * crossings);
}

std::size_t SequenceFitter::fit(const CurveFrame& frame, std::span<SequenceFit*> fits) {
  std::size_t moving = 0;
  for (std::size_t first = 0; first < fits.size(); first += PlaceBatch::most) {
    const auto some = fits.subspan(first, std::min<std::size_t>(PlaceBatch::most, fits.size() - first));
    begin(frame, some);
    spread(some);
    multiply_all(some);
    find_nearest_places(batch_, options_.normalisation, options_.interpolation);
    for (std::size_t lane = 0; lane < some.size(); ++lane)
      if (!arrives(lane, *some[lane])) std::swap(fits[moving++], fits[first + lane]);
  }
  return moving;
}

/// Where curves cross the grid around the places from which fits start.
void SequenceFitter::begin(const CurveFrame& frame, std::span<SequenceFit* const> fits) {
  if (std::ranges::all_of(fits, [](const SequenceFit* fit) { return fit->attempts > 0; })) return;
  for (std::size_t lane = 0; lane < fits.size(); ++lane) {
    for (std::size_t i = 0; i < 3; ++i) grid_.direction[i][lane] = (*fits[lane]->direction)[i];
    grid_.inverse_depth[lane] = fits[lane]->inverse_depth;
  }
  cross_grid(frame, width_, height_, grid_);
  for (std::size_t lane = 0; lane < fits.size(); ++lane) {
    SequenceFit& fit = *fits[lane];
    if (fit.attempts > 0) continue;
    fit.found = false;
    fit.moved = 0;
    fit.along_rows = grid_.along_rows[lane] > 0;
    // What is not known has no crossing in the picture.
    fit.first = grid_.known[lane] > 0 ? grid_.first[lane] : -10;
    fit.at_first = grid_.at_first[lane];
    fit.slope = grid_.slope[lane];
    fit.depth_at_first = grid_.depth_at_first[lane];
    fit.step = grid_.step[lane];
  }
}

void SequenceFitter::spread(std::span<const SequenceFit* const> fits) {
  for (std::size_t lane = 0; lane < fits.size(); ++lane) {
    grid_.along_rows[lane] = fits[lane]->along_rows ? 1 : 0;
    grid_.at_first[lane] = fits[lane]->at_first;
    grid_.slope[lane] = fits[lane]->slope;
  }
  spread_crossings(width_, height_, grid_);
}

/// The pixels around a fit's crossings, where they have sequences.
SequenceFitter::Loaded SequenceFitter::load(const SequenceFit& fit, std::size_t lane) const {
  const int length = fit.along_rows ? width_ : height_, last = (fit.along_rows ? height_ : width_) - 1;
  const bool along_lines = fit.along_rows == to_arrays_.along_rows;
  const int first = static_cast<int>(fit.first);
  const std::int32_t* low = &grid_.low[lane * crossings];
  Loaded loaded;
  loaded.crossings.share = &grid_.share[lane * crossings];
  const bool is_even = low[0] == low[1] && low[0] == low[2] && low[0] == low[3] && low[0] < last;
  if (along_lines && is_even && first >= 0 && first + static_cast<int>(crossings) <= length) {
    const std::int32_t pixel = to_arrays_.index(low[0], first);
    if (to_.are_known(pixel) && to_.are_known(pixel + to_arrays_.stride)) {
      loaded.crossings.are_neighbours = true;
      loaded.crossings.low[0] = to_arrays_.sequence(low[0], first);
      loaded.crossings.high[0] = to_arrays_.sequence(low[0] + 1, first);
      loaded.usable.fill(true);
      for (std::size_t k = 0; k < crossings; ++k) loaded.pixels[k] = pixel + static_cast<std::int32_t>(k);
      return loaded;
    }
  }
  loaded.crossings.are_neighbours = false;
  for (std::size_t k = 0; k < crossings; ++k) {
    const int main = first + static_cast<int>(k);
    const bool inside = main >= 0 && main < length, is_last = low[k] >= last;
    const int line = !inside ? 0 : along_lines ? low[k] : main, place = !inside ? 0 : along_lines ? main : low[k];
    const int next_line = line + (along_lines && inside && !is_last ? 1 : 0);
    const int next_place = place + (!along_lines && inside && !is_last ? 1 : 0);
    loaded.pixels[k] = to_arrays_.index(line, place);
    loaded.usable[k] = inside && to_.status(loaded.pixels[k]) == PixelStatus::ok &&
                       to_.status(to_arrays_.index(next_line, next_place)) == PixelStatus::ok;
    loaded.crossings.low[k] = to_arrays_.sequence(line, place);
    loaded.crossings.high[k] = to_arrays_.sequence(next_line, next_place);
  }
  return loaded;
}

/// Enters the products of pixels' sequences and those around their places.
void SequenceFitter::multiply_all(std::span<SequenceFit* const> fits) {
  batch_.count = fits.size();
  batch_.noise_share = grid_.noise_share;
  for (std::size_t lane = 0; lane < fits.size(); ++lane) {
    const SequenceFit& fit = *fits[lane];
    const Loaded loaded = load(fit, lane);
    const CrossingProducts products = multiply(to_arrays_, loaded.crossings, fit.own);
    batch_.gg[lane] = static_cast<float>(fit.own.square);
    for (std::size_t i = 0; i < crossings; ++i) {
      batch_.usable[i][lane] = loaded.usable[i] ? 1 : 0;
      batch_.gs[i][lane] = static_cast<float>(products.gs[i]);
      for (std::size_t j = i; j < crossings; ++j) batch_.ss[i][j][lane] = static_cast<float>(products.ss[i][j]);
    }
  }
}

/// Takes a fit's results. \return false if the least lies beyond the crossings, which were moved
bool SequenceFitter::arrives(std::size_t lane, SequenceFit& fit) const {
  constexpr int most_attempts = 6;
  ++fit.attempts;
  fit.share = batch_.share[lane];
  if (std::isnan(fit.share)) return true;
  const int direction = fit.share <= 0 ? -1 : fit.share >= 1 ? 1 : 0;
  // A least between two segments, at the crossing itself, is where it is.
  if (direction != 0 && direction != -fit.moved) {
    const bool is_border = !(batch_.usable[direction < 0 ? 0 : crossings - 1][lane] > 0);
    if (is_border || fit.attempts == most_attempts) return true;
    fit.moved = direction;
    fit.first += direction;
    fit.at_first += direction * fit.slope;
    fit.depth_at_first += direction * fit.step;
    return false;
  }
  const double place = 1 + fit.share, along = fit.first + place, across = fit.at_first + place * fit.slope;
  fit.inverse_depth = fit.depth_at_first + place * fit.step;
  fit.pixel = fit.along_rows ? Eigen::Vector2d(along, across) : Eigen::Vector2d(across, along);
  fit.distance_squared = batch_.distance_squared[lane];
  fit.is_cubic = batch_.is_cubic[lane] > 0;
  fit.gain = batch_.gain[lane];
  fit.doubt = batch_.doubt[lane];
  fit.change_squared = batch_.change_squared[lane];
  fit.change_along_own = batch_.change_along_own[lane];
  fit.least_sigma_px = std::sqrt(1 + fit.slope * fit.slope) * batch_.sigma[lane];
  fit.found = true;
  return true;
}

void SequenceFitter::find_sigmas(std::span<const SequenceFit* const> fits, std::span<double> sigmas_px) {
  spread(fits);
  for (std::size_t lane = 0; lane < fits.size(); ++lane) {
    const SequenceFit& fit = *fits[lane];
    const Loaded loaded = load(fit, lane);
    const CrossingWeights weights = weights_of(fit);
    double rounding_variance = from_.rounding_variance(fit.index);
    for (std::size_t k = 0; k < crossings; ++k) {
      const double value = fit.gain * weights.value[k];
      mixtures_.value[k][lane] = static_cast<float>(value);
      mixtures_.change[k][lane] = static_cast<float>(fit.gain * weights.change[k]);
      if (loaded.usable[k])
        rounding_variance += value * value * grid_.noise_share[k][lane] * to_.rounding_variance(loaded.pixels[k]);
    }
    // What a change of gain would do just as well is no change.
    mixtures_.change_of_own[lane] = static_cast<float>(-fit.change_along_own);
    enter(to_arrays_, loaded.crossings, fit.own, lane, mixtures_);
    sigmas_px[lane] = rounding_variance;
  }
  sum_weighted_residuals(to_arrays_.pairs, mixtures_);
  for (std::size_t lane = 0; lane < fits.size(); ++lane) {
    const SequenceFit& fit = *fits[lane];
    const double variance = fit.change_squared > 0 ? variance_of(fit, sigmas_px[lane], mixtures_.rrdd[lane])
                                                   : std::numeric_limits<double>::infinity();
    sigmas_px[lane] = std::sqrt((1 + fit.slope * fit.slope) * (variance + fit.doubt * fit.doubt));
  }
}

/// Residuals r and changes d of the frames give the variance [crossings^2] twice: as in any least squares,
/// mean r^2 / sum d^2, and without the belief that residuals are alike in all frames, sum r^2 d^2 / (sum d^2)^2. The
/// second is larger where the sequences differ just where they change, as beside clipped stripes; the larger one
/// counts.
/// \param rounding  variance of a sample, which is there even where clipping hides all other noise
double SequenceFitter::variance_of(const SequenceFit& fit, double rounding, double rrdd) const {
  const double alike = fit.distance_squared / batch_.freedom + rounding;
  const double weighted = rrdd * batch_.samples / batch_.freedom;
  return std::max(alike, weighted / fit.change_squared) / fit.change_squared;
}

}  // namespace pagesweep
