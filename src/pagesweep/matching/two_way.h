// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <limits>
#include <memory>
#include <span>

#include "pagesweep/matching/epipolar_curve.h"
#include "pagesweep/matching/match_epipolar.h"

namespace pagesweep {

/// The place in the other camera that belongs to one pixel, or why there is none.
struct Match {
  PixelStatus status = PixelStatus::no_match;
  Eigen::Vector2d pixel;                                    ///< [px]
  double sigma_px = 0;                                      ///< along the curve
  double inverse_depth = 0;                                 ///< [1/mm]
  double slope = std::numeric_limits<double>::quiet_NaN();  ///< [frames/px] see Correspondences

  static Match none(PixelStatus why) {
    Match match;
    match.status = why;
    return match;
  }
};

/// Finds matches from left to right. It holds scratch memory: one a thread.
class MatchFinder {
 public:
  virtual ~MatchFinder() = default;
  /// \param expected  inverse depth of the last match to the left; NaN if there is none
  virtual Match find(int x, int y, const EpipolarCurve& curve, double expected) = 0;
  /// Quick matches of the pixels (x, y), (x, y + 1), ..., as many as there are `expected` depths: what is clear at
  /// first sight. Others keep the status not_computed and are left to find().
  virtual void find_quickly(int /*x*/, int /*y*/, const EpipolarGeometry& /*geometry*/,
                            std::span<const double> /*expected*/, std::span<Match> /*matches*/) {}
};

/// One camera's pixels as they can be matched with the other's: what the two matchers differ in.
class Matcher {
 public:
  virtual ~Matcher() = default;
  /// Why the pixel cannot be matched at all; ok if it can.
  virtual PixelStatus status_of(int x, int y) const = 0;
  virtual std::unique_ptr<MatchFinder> make_finder() const = 0;
  /// Matches the rows top ... bottom - 1: some side by side, each from left to right.
  virtual void match_rows(const EpipolarGeometry& geometry, int top, int bottom, Correspondences& matches) const;
};

/// Enters one pixel's match, or why it has none.
void put(const Match& match, int x, int y, Correspondences& matches);

/// Matches all pixels both ways, finding the depth ranges first where they are not given, and keeps what agrees.
MatchPair match_both_ways(const RayTable& first, const RayTable& second, const Matcher& from_first,
                          const Matcher& from_second, const MatchOptions& options, Progress& progress);

}  // namespace pagesweep
