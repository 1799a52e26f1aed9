// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>
#include <vector>

#include "pagesweep/matching/curve_crossings_internal.h"
#include "pagesweep/matching/nearest_place.h"
#include "pagesweep/matching/sequence_kernels_internal.h"
#include "pagesweep/matching/sequence_store.h"

namespace pagesweep {

/// Where the other camera's sequence fits one pixel's, to a fraction of a pixel.
struct SequenceFit {
  std::int32_t index = 0;                    ///< of the pixel, see SequenceStore
  OwnSequence own{};                         ///< of the pixel
  const std::array<double, 3>* direction{};  ///< of the pixel, see CurveFrame
  double inverse_depth = 0;                  ///< [1/mm] near the place; then of the place
  bool found = false;                        ///< not if the best fit lies at the border of what is known
  Eigen::Vector2d pixel{0, 0};               ///< [px] in the other camera
  double distance_squared = 0;               ///< of the sequences, in the stores' own units
  double least_sigma_px = 0;                 ///< the standard deviation is no less

  /// Where the curve crosses the other camera's columns, or its rows: see CrossingBatch.
  bool along_rows = true;
  double first = 0, at_first = 0, slope = 0, depth_at_first = 0, step = 0;
  int moved = 0;     ///< the crossings, last time: -1 back, 1 ahead
  int attempts = 0;  ///< 0: to be started

  double share = 0;  ///< see PlaceBatch, as are the following
  bool is_cubic = false;
  double gain = 1, doubt = 0, change_squared = 0, change_along_own = 0;
};

/// Fits one camera's sequences to the other's between its pixels (eq. 2). Holds scratch memory: one a thread.
///
/// The other camera's sequences are interpolated where the curve crosses the pixel grid: its columns where it runs
/// along the rows, its rows where it runs along the columns. Along the curve, between crossings, see
/// find_nearest_places(); across it, linearly. Together that is the paper's bilinear sub-pixel on a curve.
class SequenceFitter {
 public:
  SequenceFitter(const SequenceStore& from, const SequenceStore& to, const MatchOptions& options);

  /// The best fits near some places of curves, a pixel's step downhill. The fits that have not arrived come first then.
  /// \return how many those are
  std::size_t fit(const CurveFrame& frame, std::span<SequenceFit*> fits);
  /// Standard deviations [px] of fits that were found, at most one batch, along their curves; infinite where the
  /// sequence does not change.
  void find_sigmas(std::span<const SequenceFit* const> fits, std::span<double> sigmas_px);

 private:
  struct Loaded {
    Crossings crossings;
    std::array<std::int32_t, Crossings::count> pixels;  ///< the first of the two beside a crossing
    std::array<bool, Crossings::count> usable;
  };

  void begin(const CurveFrame& frame, std::span<SequenceFit* const> fits);
  void spread(std::span<const SequenceFit* const> fits);
  Loaded load(const SequenceFit& fit, std::size_t lane) const;
  void multiply_all(std::span<SequenceFit* const> fits);
  bool arrives(std::size_t lane, SequenceFit& fit) const;
  double variance_of(const SequenceFit& fit, double rounding, double rrdd) const;

  const SequenceStore& from_;
  const SequenceStore& to_;
  const SequenceArrays& to_arrays_;
  const MatchOptions& options_;
  int width_, height_;  ///< of the other picture
  PlaceBatch batch_;
  CrossingBatch grid_;
  MixtureBatch mixtures_;
};

}  // namespace pagesweep
