// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <limits>
#include <memory>
#include <vector>

#include "pagesweep/matching/agreement.h"
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

/// Finds the matches of single pixels. It holds scratch memory: one a thread.
class MatchFinder {
 public:
  virtual ~MatchFinder() = default;
  /// \param expected  inverse depth of a neighbour's match; NaN if there is none
  virtual Match find(int x, int y, const EpipolarCurve& curve, double expected) = 0;
};

/// One camera's pixels as they can be matched with the other's: what the two matchers differ in.
class PixelMatcher {
 public:
  /// \param only  pixels that are wanted; null: all
  explicit PixelMatcher(const PixelSet* only = nullptr) : only_(only) {}
  virtual ~PixelMatcher() = default;
  bool is_wanted(int x, int y) const { return takes_part(only_, x, y); }
  bool wants_any_of(int y) const { return any_takes_part(only_, y); }
  /// Why the pixel cannot be matched at all; ok if it can.
  virtual PixelStatus status_of(int x, int y) const = 0;
  virtual std::unique_ptr<MatchFinder> make_finder() const = 0;
  /// Matches the rows top ... bottom - 1. What it remembers from row to row it forgets before the first one.
  virtual void match_rows(const EpipolarGeometry& geometry, int top, int bottom, Correspondences& matches) const = 0;

 private:
  const PixelSet* only_;
};

/// Looks for one pixel's match on its curve, see MatchFinder::find().
Match find_match(const EpipolarGeometry& geometry, MatchFinder& finder, int x, int y, double expected);

/// Enters one pixel's match, or why it has none.
void put(const Match& match, int x, int y, Correspondences& matches);

/// Both ways between two cameras, all pixels at once or part by part.
class TwoWayMatching {
 public:
  /// The cameras must outlive this.
  /// \throws std::invalid_argument  if they are at one place or near_mm, far_mm contradict each other
  TwoWayMatching(const RayTable& first, const RayTable& second, const MatchOptions& options);

  /// Finds matches of the pixels that the matchers want, and the depth ranges first where they are not given: those of
  /// all parts so far.
  void match(const PixelMatcher& from_first, const PixelMatcher& from_second, Progress& progress);
  /// Keeps what agrees.
  void keep_agreeing(const PixelSets& only) { pagesweep::keep_agreeing(pair_, found_, max_disagreement_px_, only); }

  /// What was found so far. Where a status is not ok, other values mean nothing.
  const MatchPair& matches() const& { return pair_; }
  /// To be taken away; where a status is not ok, other values are NaN.
  MatchPair matches() &&;

 private:
  /// Depths in one camera and in the other.
  struct DepthRanges {
    InverseDepthRange there, back;
  };
  /// What probes found: depths in one camera and in the other.
  struct Probes {
    std::vector<double> there, back;
  };
  struct Direction;
  void probe(const Direction& there, const Direction& back, const DepthRanges& ranges, int probes, Probes& found) const;
  DepthRanges find_ranges(const Direction& there, const Direction& back);
  void match_one_way(const Direction& direction, InverseDepthRange range, Progress& progress, Correspondences& matches);

  const RayTable& first_;
  const RayTable& second_;
  double max_disagreement_px_;
  InverseDepthRange allowed_;
  bool range_is_known_;
  EpipolarGeometry there_, back_;  ///< of no range
  Probes few_, many_;
  MatchPair pair_;
  FoundStatus found_;
};

/// Matches all pixels both ways and keeps what agrees.
MatchPair match_both_ways(const RayTable& first, const RayTable& second, const PixelMatcher& from_first,
                          const PixelMatcher& from_second, const MatchOptions& options, Progress& progress);

}  // namespace pagesweep
