// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>

#include "pagesweep/data/time_map.h"
#include "pagesweep/matching/match_epipolar.h"
#include "pagesweep/matching/time_field.h"
#include "pagesweep/matching/two_way.h"

namespace pagesweep {

/// match_times() while the stripe is still on its way: what is known of both cameras' times is matched, part by part.
///
/// A pixel can be matched when the other camera has the times of all pixels that the stripe passed by then. The range
/// of depths is that of all parts so far.
class TimeMatching {
 public:
  /// The cameras must outlive this. \throws std::invalid_argument  see match_times()
  TimeMatching(const RayTable& first, const RayTable& second, const MatchOptions& options = {});

  /// Looks for the matches of some pixels, those of which both cameras' times are new.
  /// \throws std::invalid_argument  if a map's size is not its camera's
  void match(const TimeMap& first, const TimeMap& second, const PixelSets& only, Progress& progress = no_progress());
  /// Of some pixels, keeps the matches that are confirmed from the other side. When those around are matched as well.
  void keep_agreeing(const PixelSets& only) { two_way_.keep_agreeing(only); }

  /// \see TwoWayMatching
  const MatchPair& matches() const& { return two_way_.matches(); }
  MatchPair matches() && { return std::move(two_way_).matches(); }

 private:
  const RayTable& first_;
  const RayTable& second_;
  double max_sigma_px_;
  TwoWayMatching two_way_;
  TimeField first_field_, second_field_;
};

}  // namespace pagesweep
