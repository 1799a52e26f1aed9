// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "pagesweep/matching/epipolar_curve.h"
#include "pagesweep/matching/nearest_place.h"
#include "pagesweep/matching/sequence_store.h"

namespace pagesweep {

/// Where one pixel's sequence fits best, to a fraction of a pixel.
struct SequenceFit {
  Eigen::Vector2d pixel;        ///< [px] on the curve
  double inverse_depth = 0;     ///< [1/mm]
  double sigma_px = 0;          ///< along the curve; infinite where the sequence does not change along it
  double distance_squared = 0;  ///< of the sequences, in the store's own units
};

/// Fits one camera's sequences to the other's between its pixels (eq. 2). Holds scratch memory: one a thread.
///
/// The other camera's sequences are interpolated where the curve crosses the pixel grid: its columns where it runs
/// along the rows, its rows where it runs along the columns. Along the curve, between crossings, see nearest_place();
/// across it, linearly. Together that is the paper's bilinear sub-pixel on a curve.
class SequenceFitter {
 public:
  SequenceFitter(const SequenceStore& from, const SequenceStore& to, const MatchOptions& options)
      : from_(from), to_(to), options_(options), affine_(options.normalisation == Normalisation::affine) {}

  /// The best fit within one or two pixels of a place of the curve; nothing if it lies at the border of what is known.
  std::optional<SequenceFit> fit(int x, int y, const EpipolarCurve& curve, double inverse_depth);

 private:
  static constexpr int crossings = SequenceProducts::crossings;

  bool find_crossings(const EpipolarCurve& curve, double inverse_depth);
  void interpolate(std::size_t crossing);
  SequenceProducts products() const;
  CurvePlace nearest_without_noise(const SequenceProducts& all) const;
  double noise_variance(const CurvePlace& place) const;
  /// The crossing that the first of a place's weights belongs to.
  static std::size_t first_of(const CurvePlace& place) { return static_cast<std::size_t>(place.segment - 1); }
  double sigma(const CurvePlace& place, double rounding_variance);
  /// Samples of a sequence less the unknowns: the place and, if free, gain and offset.
  double freedom() const { return std::max(1.0, from_.samples() - (affine_ ? 3.0 : 1.0)); }

  const SequenceStore& from_;
  const SequenceStore& to_;
  const MatchOptions& options_;
  bool affine_;

  bool along_rows_ = true;                              ///< the curve runs along the picture's rows
  int first_ = 0;                                       ///< column (or row) of the first crossing
  double at_first_ = 0, slope_ = 0;                     ///< the other coordinate there, and its change a crossing
  double depth_at_first_ = 0, depth_step_ = 0;          ///< inverse depth likewise
  std::array<bool, crossings> usable_{};                ///< the pixels beside the crossing have sequences
  std::array<std::vector<float>, crossings> sequence_;  ///< interpolated
  std::array<double, crossings> weight_squares_{};      ///< of the interpolation: what it leaves of noise
  std::array<double, crossings> rounding_variance_{};   ///< of the sequences' samples
  std::vector<float> own_, residual_, change_;
};

}  // namespace pagesweep
