// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/sequence_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace pagesweep {
namespace {

float dot(const std::vector<float>& a, const std::vector<float>& b) {
  std::array<float, SequenceStore::lanes> sums{};
  for (std::size_t i = 0; i < a.size(); i += sums.size())
    for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += a[i + k] * b[i + k];
  float sum = 0;
  for (const float s : sums) sum += s;
  return sum;
}

/// Takes out of `change` what a change of gain would do just as well.
void remove_gain(const std::vector<float>& sequence, std::vector<float>& change) {
  const float square = dot(sequence, sequence);
  const float share = square > 0 ? dot(change, sequence) / square : 0;
  for (std::size_t k = 0; k < change.size(); ++k) change[k] -= share * sequence[k];
}

}  // namespace

std::optional<SequenceFit> SequenceFitter::fit(int x, int y, const EpipolarCurve& curve, double inverse_depth) {
  constexpr int most_moves = 4;
  const std::int16_t* sequence = from_.sequence(x, y);
  own_.assign(sequence, sequence + from_.length());
  for (int move = 0; move < most_moves; ++move) {
    if (!find_crossings(curve, inverse_depth)) return std::nullopt;
    const CurvePlace nearest = nearest_without_noise(products());
    if (nearest.segment < 0 || nearest.at_end) return std::nullopt;
    const double place = nearest.segment + nearest.share;
    inverse_depth = depth_at_first_ + place * depth_step_;
    if (place <= 1 || place >= crossings - 2) continue;  // at the window's edge: the least lies beyond
    const auto pixel = curve.at(inverse_depth);
    if (!pixel) return std::nullopt;
    const double length = std::hypot(1.0, slope_);  // [px] along the curve a crossing
    const double sigma_px = length * std::hypot(sigma(nearest, from_.rounding_variance(x, y)), nearest.doubt);
    return SequenceFit{*pixel, inverse_depth, sigma_px, nearest.distance_squared};
  }
  return std::nullopt;
}

/// The curve's tangent at a place, and where it crosses the grid around. Over three pixels no lens bends the curve by
/// more than a thousandth of a pixel.
bool SequenceFitter::find_crossings(const EpipolarCurve& curve, double inverse_depth) {
  double step = 0.5 / curve.speed(inverse_depth);
  const auto here = curve.at(inverse_depth);
  auto there = curve.at(inverse_depth + step);
  if (!there) {
    step = -step;
    there = curve.at(inverse_depth + step);
  }
  if (!here || !there) return false;
  const Eigen::Vector2d change = *there - *here;
  along_rows_ = std::abs(change.x()) >= std::abs(change.y());
  const int main = along_rows_ ? 0 : 1;
  if (change[main] == 0) return false;
  slope_ = change[1 - main] / change[main];
  depth_step_ = step / change[main];
  first_ = static_cast<int>(std::floor((*here)[main])) - (crossings / 2 - 1);
  const double back = first_ - (*here)[main];
  at_first_ = (*here)[1 - main] + back * slope_;
  depth_at_first_ = inverse_depth + back * depth_step_;
  for (std::size_t i = 0; i < crossings; ++i) interpolate(i);
  return true;
}

void SequenceFitter::interpolate(std::size_t crossing) {
  const int main = first_ + static_cast<int>(crossing);
  const int length = along_rows_ ? to_.width() : to_.height(), breadth = along_rows_ ? to_.height() : to_.width();
  const double across = std::clamp(at_first_ + static_cast<double>(crossing) * slope_, 0.0, breadth - 1.0);
  const int low = std::min(static_cast<int>(across), std::max(0, breadth - 2)), high = std::min(low + 1, breadth - 1);
  const auto share = static_cast<float>(across - low);
  usable_[crossing] = false;
  if (main < 0 || main >= length) return;
  const auto place = [&](int other) { return along_rows_ ? std::pair(main, other) : std::pair(other, main); };
  const auto [x0, y0] = place(low);
  const auto [x1, y1] = place(high);
  if (to_.status(x0, y0) != PixelStatus::ok || to_.status(x1, y1) != PixelStatus::ok) return;
  usable_[crossing] = true;
  const std::int16_t* a = to_.sequence(x0, y0);
  const std::int16_t* b = to_.sequence(x1, y1);
  std::vector<float>& out = sequence_[crossing];
  out.resize(static_cast<std::size_t>(to_.length()));
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = a[i] + share * static_cast<float>(b[i] - a[i]);
  weight_squares_[crossing] = (1 - share) * (1 - share) + share * share;
  rounding_variance_[crossing] = std::max(to_.rounding_variance(x0, y0), to_.rounding_variance(x1, y1));
}

SequenceProducts SequenceFitter::products() const {
  SequenceProducts p;
  p.gg = dot(own_, own_);
  p.usable = usable_;
  p.gs.setZero();
  p.ss.setZero();
  for (std::size_t i = 0; i < crossings; ++i) {
    if (!usable_[i]) continue;
    p.gs[static_cast<Eigen::Index>(i)] = dot(own_, sequence_[i]);
    for (std::size_t j = i; j < crossings; ++j) {
      if (!usable_[j]) continue;
      const auto row = static_cast<Eigen::Index>(i), column = static_cast<Eigen::Index>(j);
      p.ss(row, column) = p.ss(column, row) = dot(sequence_[i], sequence_[j]);
    }
  }
  return p;
}

/// Variance of a stored sample of the other camera, if both cameras share in the residual alike.
double SequenceFitter::noise_variance(const CurvePlace& place) const {
  double shares = 1;
  for (std::size_t k = 0; k < 4; ++k)
    shares +=
        std::pow(place.gain * place.value[static_cast<Eigen::Index>(k)], 2) * weight_squares_[first_of(place) + k];
  return place.distance_squared / (freedom() * shares);
}

/// Noise is independent from crossing to crossing, so that a mixture of two has less of it, and a sum of squared
/// differences that counts it is drawn towards the middle. Its expected part is taken out of the products.
CurvePlace SequenceFitter::nearest_without_noise(const SequenceProducts& all) const {
  const auto refined = [&](const SequenceProducts& p, const CurvePlace& start) {
    return nearest_place(p, start, options_.normalisation, options_.interpolation);
  };
  const CurvePlace first = nearest_on_polyline(all, options_.normalisation);
  if (first.segment < 0) return first;
  SequenceProducts p = all;
  const double noise = noise_variance(first) * from_.samples();
  for (std::size_t i = 0; i < crossings; ++i) {
    const auto index = static_cast<Eigen::Index>(i);
    p.ss(index, index) -= noise * weight_squares_[i];
  }
  CurvePlace place = nearest_on_polyline(p, options_.normalisation);
  // Noise never moves a place by more; then it was something else that is not alike.
  constexpr double farthest = 0.5;
  if (!(std::abs(place.segment + place.share - first.segment - first.share) < farthest)) return refined(all, first);
  place = refined(p, place);
  place.distance_squared = distance_squared(all, place, options_.normalisation);
  return place;
}

/// Standard deviation of a place [crossings]. Residuals r and changes d of the frames give it twice: as in any least
/// squares, sqrt(mean r^2 / sum d^2), and without the belief that residuals are alike in all frames,
/// sqrt(sum r^2 d^2) / sum d^2. The second is larger where the sequences differ just where they change, as beside
/// clipped stripes; the larger one counts.
double SequenceFitter::sigma(const CurvePlace& place, double rounding_variance) {
  residual_ = own_;
  change_.assign(own_.size(), 0);
  double change_noise = 0;
  for (std::size_t part = 0; part < 4; ++part) {
    const std::size_t i = first_of(place) + part;
    const auto value = static_cast<float>(place.gain * place.value[static_cast<Eigen::Index>(part)]);
    const auto change = static_cast<float>(place.gain * place.derivative[static_cast<Eigen::Index>(part)]);
    if (value == 0 && change == 0) continue;
    for (std::size_t k = 0; k < residual_.size(); ++k) {
      residual_[k] -= value * sequence_[i][k];
      change_[k] += change * sequence_[i][k];
    }
    rounding_variance += value * value * weight_squares_[i] * rounding_variance_[i];
    change_noise += change * change * weight_squares_[i];
  }
  if (affine_) remove_gain(own_, change_);
  // Rounding is there even where clipping hides all other noise.
  const double noise = dot(residual_, residual_) / freedom() + rounding_variance;
  for (std::size_t k = 0; k < residual_.size(); ++k) residual_[k] *= change_[k];
  const double weighted = dot(residual_, residual_) * from_.samples() / freedom();
  // Noise of the crossings looks like change; only what exceeds it, and its chi-squared scatter, is known to be change.
  const double noise_energy = noise_variance(place) * change_noise * from_.samples();
  const double change_squared = dot(change_, change_) - noise_energy * (1 + 3 * std::sqrt(2.0 / from_.samples()));
  if (!(change_squared > 0)) return std::numeric_limits<double>::infinity();
  return std::max(std::sqrt(noise / change_squared), std::sqrt(weighted) / change_squared);
}

}  // namespace pagesweep
