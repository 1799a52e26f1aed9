// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "pagesweep/data/time_map.h"
#include "pagesweep/matching/time_field.h"
#include "pagesweep/matching/two_way.h"

namespace pagesweep {

/// A camera's times as the other one's pixels look for theirs in it.
struct SearchedMap {
  const TimeField* field;
  double brightness;    ///< of this camera's pixels over those of the camera that searches
  double max_sigma_px;  ///< of a match
};

/// What is the same for all pixels that look into it.
CurveBatch make_batch(const SearchedMap& to, const EpipolarGeometry& geometry);

/// Equal times along the epipolar curves of single pixels: a close look at what is not clear at first sight.
class TimeFinder final : public MatchFinder {
 public:
  /// What is given must outlive this.
  TimeFinder(const TimeMap& from, const SearchedMap& to) : from_(from), to_(to) {}

  Match find(int x, int y, const EpipolarCurve& curve, double expected) override;

 private:
  struct Wanted;
  /// Ratio of the amplitudes of a pixel and of its match, whichever is larger.
  double contrast(double root, const Wanted& wanted) const;
  /// Looks along the whole curve.
  Match search(const Wanted& wanted, double expected);
  Match match_at(double root, const Wanted& wanted) const;
  /// \return whether the other camera sees anything of the curve
  bool find_roots(const Wanted& wanted);

  const TimeMap& from_;
  SearchedMap to_;
  std::vector<std::size_t> changes_;  ///< along a curve, see search_curve()
  std::vector<double> roots_;
};

}  // namespace pagesweep
