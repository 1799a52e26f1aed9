// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "pagesweep/data/picture.h"

namespace pagesweep {

/// Packs samples as a JPEG 2000 file (ISO/IEC 15444-1) the way archives ask for it: without loss (5-3 wavelet,
/// reversible colour transform), one tile, up to 5 decompositions, code blocks of 64 x 64, precincts of 256 x 256 in
/// the two finest resolutions and 128 x 128 below, ordered by resolution, position, component and layer (RPCL), with
/// markers before each packet and after its header (SOP, EPH) and tables of tile-part and packet lengths (TLM, PLT).
/// \throws std::runtime_error  if OpenJPEG fails
std::string pack_jp2(const Picture& picture);

}  // namespace pagesweep
