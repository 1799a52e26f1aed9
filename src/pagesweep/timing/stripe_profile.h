// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

namespace pagesweep {

/// The moving stripe as a pixel of even paper sees it: light over time, as a uniform cubic B-spline (twice continuously
/// differentiable). Its height is 1, it is 0 outside its support, and no shape is assumed: it may be skewed or
/// flat-topped.
///
/// Its time origin, to which all time values refer, is its centre of mass.
class StripeProfile {
 public:
  /// Height and slope [1/frame] at one moment.
  struct Sample {
    double value = 0;
    double slope = 0;
  };
  /// A measured point of the profile. Weight is 1 / variance, up to a common factor.
  struct Point {
    double time = 0;  ///< [frames]
    double value = 0;
    double weight = 1;
  };

  StripeProfile() = default;
  /// The spline through weighted points by least squares, 0 with slope and curvature at both ends, then normalised in
  /// height and origin. A gap between the points is bridged smoothly: the third differences of the coefficients carry
  /// `smoothing` times the mean weight of a coefficient as a penalty.
  /// \param begin, end  support [frames], in the time of the points
  /// \param spacing     between knots [frames]
  /// \throws std::invalid_argument  if the support holds fewer than 4 knots, or nothing rises above 0
  static StripeProfile fit(std::span<const Point> points, double begin, double end, double spacing,
                           double smoothing = 1e-4);

  double begin() const { return begin_; }  ///< [frames] of the support
  double end() const { return begin_ + spacing_ * static_cast<double>(pieces_.size()); }
  /// Centre of mass of what rises above a fifth of the height [frames]: what the centre-of-mass estimator finds,
  /// because it must keep away from noisy tails. 0 for a symmetric stripe.
  double upper_centre() const { return upper_centre_; }
  bool empty() const { return pieces_.empty(); }
  /// Duration between the two moments at half height [frames].
  double full_width_half_maximum() const { return fwhm_; }

  Sample at(double time) const {
    const double x = (time - begin_) * knots_per_frame_;
    if (!(x >= 0 && x < count_)) return {};
    const auto i = static_cast<int>(x);
    const Piece& p = pieces_[static_cast<std::size_t>(i)];
    const double u = x - i;
    return {((p.c3 * u + p.c2) * u + p.c1) * u + p.c0, ((3 * p.c3 * u + 2 * p.c2) * u + p.c1) * knots_per_frame_};
  }
  double value(double time) const { return at(time).value; }
  double derivative(double time) const { return at(time).slope; }

 private:
  /// One polynomial between two knots, in u = 0..1.
  struct Piece {
    double c0 = 0, c1 = 0, c2 = 0, c3 = 0;
  };
  void set_coefficients(std::span<const double> coefficients);
  void normalise();
  double centre_above(double threshold) const;
  void measure_width();

  double begin_ = 0;
  double spacing_ = 1;
  double knots_per_frame_ = 1;
  double count_ = 0;
  double fwhm_ = 0;
  double upper_centre_ = 0;
  std::vector<Piece> pieces_;
};

/// Share of a bell's height that the centre-of-mass estimator leaves out, see StripeProfile::upper_centre().
inline constexpr double centre_threshold = 0.2;

}  // namespace pagesweep
