// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>

#include "pagesweep/data/pixel_set.h"
#include "pagesweep/matching/match_epipolar.h"

namespace pagesweep {

/// Pixels of both cameras.
struct PixelSets {
  const PixelSet* first = nullptr;   ///< null: all
  const PixelSet* second = nullptr;  ///< null: all
};

/// What both directions found before they were compared.
using FoundStatus = std::pair<Image<PixelStatus>, Image<PixelStatus>>;

/// Marks as inconsistent every match from which the other direction does not lead back.
///
/// The other camera's own matches around the matched place, those of up to four pixels, are carried over to it and
/// must end at this pixel within max_px or four standard deviations, whichever is more. Where none of the four has a
/// match, nothing confirms this one, and it goes too; but if all four look out of this camera's picture, nothing can,
/// and it stays.
/// \param only  pixels to be judged
void keep_agreeing(MatchPair& pair, const FoundStatus& found, double max_px, const PixelSets& only);

}  // namespace pagesweep
