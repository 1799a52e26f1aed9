// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "pagesweep/matching/follow_curves.h"
#include "pagesweep/matching/sequence_arrays_internal.h"

namespace pagesweep {

/// What all epipolar curves in a picture have in common. The picture of the point at inverse depth w is that of
/// direction + w origin.
struct CurveFrame {
  LensNumbers lens;
  std::array<double, 3> origin;
  std::array<double, 2> lowest, highest;  ///< ideal coordinates that the picture can show
  double far, near;                       ///< [1/mm] the range of inverse depths
};

/// An epipolar curve: before the lens bends it, in ideal coordinates, a straight line with places at (x, y) + k (dx,
/// dy) about a pixel apart; and in the picture, where its ends are, as lines and places of SequenceArrays.
struct CurveLine {
  float x, y, dx, dy;
  float count;             ///< 0 if nothing of it can be seen
  float from, to;          ///< places at its ends
  float line_at_0, slope;  ///< of the straight line between them: which line it is at, place by place
  float straight;          ///< 1 if that serves for all of it: less than a tenth of a pixel beside it
};

/// The curves of some pixels, one entry a pixel.
struct LineBatch {
  static constexpr int most = 16;
  template <class T>
  using Each = std::array<T, most>;

  alignas(64) std::array<Each<double>, 3> direction{};  ///< NaN where there is none
  alignas(64) Each<float> x{}, y{}, dx{}, dy{}, count{}, from{}, to{}, line_at_0{}, slope{}, straight{};  ///< see above
  alignas(64) Each<float> far{}, near{};      ///< [1/mm] at both ends
  alignas(64) Each<float> z_far{}, z_near{};  ///< of the points there, up to a common scale

  CurveLine line(std::size_t k) const {
    return {x[k], y[k], dx[k], dy[k], count[k], from[k], to[k], line_at_0[k], slope[k], straight[k]};
  }
};
/// \param along_rows  see SequenceArrays
void lay_lines(const CurveFrame& frame, bool along_rows, LineBatch& batch);

/// A curve's places in the other picture, one for each of a line's that it passes (or, where it does not run along the
/// lines, one for each of the CurveLine's), and how unlike their sequences are.
struct ScoredCurve {
  int count = 0;
  std::int32_t least = 0;            ///< score
  float first = 0;                   ///< place that stands first; NaN if they are the CurveLine's
  std::vector<std::int32_t> scores;  ///< a highest one where the picture does not show it
  std::vector<std::int32_t> pixels;  ///< -1 there
  std::vector<float> nodes;          ///< places at even steps along the CurveLine, from its beginning to its end
  std::vector<float> across;         ///< lines at the nodes

  const std::int32_t* first_score() const { return scores.data() + score_padding; }
  bool sees_anything() const { return least < std::numeric_limits<std::int32_t>::max(); }
  /// How far along the CurveLine an interpolated place is, from 0 to 1.
  float share_at(float place) const;
  /// The pixel of an entry, -1 if the picture does not show it.
  std::int32_t pixel_at(int entry) const { return pixels[static_cast<std::size_t>(score_padding + entry)]; }
};

/// Compares a sequence with those of the pixels nearest to a curve's places: sums of squared differences (eq. 1).
void score_curve(const SequenceArrays& to, const LensNumbers& lens, const CurveLine& line, const OwnSequence& own,
                 ScoredCurve& curve);

/// Places on a curve that may be the match, one entry each.
struct CurveMinima {
  int count = 0;
  std::vector<std::int32_t> place, score;               ///< entries of the curve
  std::vector<std::int32_t> beside, beside_score;       ///< the better one of their neighbours, which may be none
  std::vector<float> improved_place, distance_squared;  ///< interpolated between both

  /// \param entries  of the curve
  void make_room(int entries);
};

/// The places whose scores are at most `limit`, lower than the one before and not higher than the one behind.
void find_minima(const ScoredCurve& curve, std::int32_t limit, CurveMinima& minima);

/// Interpolates linearly towards the better one of each minimum's neighbours.
/// \param affine  see Normalisation
void improve_minima(const SequenceArrays& to, const ScoredCurve& curve, std::int32_t own_square, bool affine,
                    CurveMinima& minima);

}  // namespace pagesweep
