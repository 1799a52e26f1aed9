// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/data/picture.h"
#include "pagesweep/evaluation/compare_pages.h"
#include "pagesweep/evaluation/statistics.h"

namespace pagesweep {

/// How much a flat page looks like the printed one.
struct PictureErrors {
  double ms_ssim = ErrorSummary::none;                ///< of the gray values as they are stored
  double ms_ssim_same_exposure = ErrorSummary::none;  ///< after the gain and offset that bring the result closest
};

/// Multi-scale structural similarity (see ms_ssim()) in gray. The true page is sampled with a cubic where the pixels of
/// the result are, after the turn and shift of `alignment`, which no reader sees; nothing is done to the result.
/// Compared is a large upright rectangle of the result whose corners lie on the true page.
/// \param alignment  what compare_pages() says of the same result and truth
/// \return  NaN if the pages hardly overlap
/// \pre     both pictures say their pixels_per_mm
PictureErrors compare_pictures(const Picture& result, const Picture& truth, const PageErrors& alignment);

}  // namespace pagesweep
