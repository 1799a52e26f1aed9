// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>
#include <vector>

#include "pagesweep/matching/epipolar_curve.h"
#include "pagesweep/matching/nearest_place.h"
#include "pagesweep/matching/sequence_store.h"

namespace pagesweep {

/// Where the other camera's sequence fits one pixel's, to a fraction of a pixel.
struct SequenceFit {
  int x = 0, y = 0;                      ///< the pixel
  const EpipolarCurve* curve = nullptr;  ///< of the pixel
  double inverse_depth = 0;              ///< [1/mm] near the place; then of the place
  bool found = false;                    ///< not if the best fit lies at the border of what is known
  Eigen::Vector2d pixel{0, 0};           ///< [px] in the other camera
  double distance_squared = 0;           ///< of the sequences, in the stores' own units

  /// Where the curve crosses the other camera's columns, or its rows if it runs along the columns.
  bool along_rows = true;
  int first = 0;                        ///< column (or row) of the first crossing
  double at_first = 0, slope = 0;       ///< the other coordinate there, and its change a crossing
  double depth_at_first = 0, step = 0;  ///< [1/mm] inverse depth there, and its change a crossing
  int moved = 0;                        ///< the crossings, last time: -1 back, 1 ahead
  std::array<Crossing, PlaceBatch::crossings> crossings{};
  std::array<std::int32_t, PlaceBatch::crossings> crossed{};  ///< the first of the two pixels beside a crossing
  std::array<double, PlaceBatch::crossings> noise_share{};    ///< what is left of the pixels' noise variance

  double share = 0;  ///< see PlaceBatch, as are the following
  bool is_cubic = false;
  double gain = 1, doubt = 0, noise_variance = 0;
  double change_along_own = 0;  ///< part of the interpolated sequence's change that a gain could mimic, in own ones

  /// Starts anew.
  void begin(int column, int row, const EpipolarCurve& its_curve, double near_depth) {
    x = column;
    y = row;
    curve = &its_curve;
    inverse_depth = near_depth;
    found = false;
    moved = 0;
  }
};

/// Fits one camera's sequences to the other's between its pixels (eq. 2). Holds scratch memory: one a thread.
///
/// The other camera's sequences are interpolated where the curve crosses the pixel grid: its columns where it runs
/// along the rows, its rows where it runs along the columns. Along the curve, between crossings, see
/// find_nearest_places(); across it, linearly. Together that is the paper's bilinear sub-pixel on a curve.
class SequenceFitter {
 public:
  SequenceFitter(const SequenceStore& from, const SequenceStore& to, const MatchOptions& options);

  /// The best fits near some places of curves, downhill.
  void fit(std::span<SequenceFit> fits);
  /// Standard deviation of a fit [px] along the curve; infinite where the sequence does not change along it.
  double sigma_px(const SequenceFit& fit) const;

 private:
  void load(SequenceFit& fit, std::size_t lane);
  bool place_crossings(SequenceFit& fit) const;
  void interpolate(SequenceFit& fit, std::size_t lane);
  bool take(std::size_t lane, SequenceFit& fit) const;

  const SequenceStore& from_;
  const SequenceStore& to_;
  SequenceArrays to_arrays_;
  const MatchOptions& options_;
  bool affine_;
  PlaceBatch batch_;
  std::vector<SequenceFit*> waiting_, moved_;
};

}  // namespace pagesweep
