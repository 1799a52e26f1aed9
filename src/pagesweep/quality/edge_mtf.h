// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/data/page.h"
#include "pagesweep/quality/paper_look.h"

namespace pagesweep {

/// Modulation transfer over spatial frequency, evenly spaced from 0.
struct Mtf {
  double step = 1.0 / 64;      ///< [cycles a pixel of the page]
  std::vector<double> values;  ///< values[0] is 1; empty: no edges

  double at(double frequency) const;
  /// Lowest frequency at which it falls below a level; the last one if it never does, 0 if there is none.
  double frequency_at(double level) const;
};

/// Sharpness along one direction of a page, from the edges that happen to be printed on it.
struct EdgeSharpness {
  Mtf page;       ///< of the page's picture
  Mtf scan;       ///< of the scan at the same edges, over the page's frequencies
  int edges = 0;  ///< that it rests on
};

/// A straight piece of an edge of print, as it runs through rows of a picture: x = x0 + slope (y - y0).
struct PrintedEdge {
  double x0 = 0, slope = 0;
  int y0 = 0, rows = 0;
  bool ink_at_right = true;
};

/// Upright edges of print in a picture of light: straight over at least `least_rows` rows to a fifth of a pixel, with
/// even paper on one side and even ink on the other for at least 3 pixels each.
std::vector<PrintedEdge> find_printed_edges(const Image<float>& light, int least_rows = 10);

/// The modulation transfer function by the edge method (ISO 12233:2017, 6.2): pixels of all edges, by their distance
/// from their own edge in quarters of a pixel, give the edge spread function; its derivative, in a window of 3 px to
/// either side, the line spread function; and the size of its Fourier transform is the result. The page's rows, turned
/// by its own sampling, replace the slant of a target: edges lie at all phases of the pixel grid.
/// \return             along x (from upright edges) and along y (from level ones)
std::array<EdgeSharpness, 2> measure_sharpness(const Page& page, const Image<float>& page_light,
                                               const PictureLight& scan);

/// The transfer function of an edge spread function sampled every 1 / oversampling px, its middle in the middle.
Mtf transfer_of(const std::vector<double>& edge_spread, int oversampling);

}  // namespace pagesweep
