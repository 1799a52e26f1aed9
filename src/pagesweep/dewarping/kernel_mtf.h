// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/dewarping/resample.h"

namespace pagesweep {

/// The share of a wave that resampling keeps, averaged over all positions between the scan's pixels: the modulation
/// transfer function of the interpolation kernel.
/// \param frequency_per_px  of the wave, in cycles a pixel of the scan
/// \param width             by which the kernel is widened, 1 or more: see resample()
double kernel_mtf(ResampleKernel kernel, double width, double frequency_per_px);

}  // namespace pagesweep
