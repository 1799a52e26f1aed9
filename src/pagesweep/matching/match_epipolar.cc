// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/match_epipolar.h"

#include <utility>

#include "pagesweep/matching/time_matching.h"

namespace pagesweep {

MatchPair match_times(const TimeMap& first, const TimeMap& second, const RayTable& first_camera,
                      const RayTable& second_camera, const MatchOptions& options, Progress& progress) {
  TimeMatching matching(first_camera, second_camera, options);
  matching.match(first, second, {}, progress);
  matching.keep_agreeing({});
  return std::move(matching).matches();
}

}  // namespace pagesweep
