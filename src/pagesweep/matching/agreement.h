// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/matching/match_epipolar.h"

namespace pagesweep {

/// Marks as inconsistent every match from which the other direction does not lead back.
///
/// The other camera's own matches around the matched place, those of up to four pixels, are carried over to it and
/// must end at this pixel within max_px or four standard deviations, whichever is more. Where none of the four has a
/// match, nothing confirms this one, and it goes too; but if all four look out of this camera's picture, nothing can,
/// and it stays.
void keep_agreeing(MatchPair& pair, double max_px);

}  // namespace pagesweep
