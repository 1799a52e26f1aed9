// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>

#include "pagesweep/base/image.h"
#include "pagesweep/data/status.h"

namespace pagesweep {

/// One side of paper as measured, and its flattening: where paper spot (s, t) lies in the rig frame.
///
/// Paper coordinates are millimetres along the paper: s to the reader's right, t down the page, so that
/// (s, t) is oriented as the pixels of the flat page are. They are given on a regular grid: node (i, j)
/// is at s = s0 + i spacing, t = t0 + j spacing. The grid may reach beyond the paper: the outline is
/// dewarping's business.
///
/// `model` is the smooth surface model of paper section IV step 1, `measured` the measurement that lies
/// orthogonally above each model point (step 2; eq. 12 is the difference of their pictures in the scan).
/// Where nothing was measured, `measured` eases from the nearest measurements to `model` and `status` says why.
struct PageSurface {
  int index = 1;           ///< page number from left to right, 1 first
  std::string model_name;  ///< "cylinder", "developable", ...
  double spacing_mm = 2;
  double s0_mm = 0;
  double t0_mm = 0;
  Image<Eigen::Vector3f> model;     ///< [mm] rig frame
  Image<Eigen::Vector3f> measured;  ///< [mm] rig frame
  Image<float> sigma;               ///< [mm] one standard deviation of `measured` along the normal; NaN: bridged
  Image<PixelStatus> status;        ///< of `measured`
  /// [mm] By how much something that is not the paper (finger, clip, slip) stands above it at a node; NaN where nothing
  /// does. Such nodes have the status `covered`, and `measured` is the paper below. Empty: not looked for.
  Image<float> cover_mm;
  /// By how much the sheet seems stretched around a node, relative, and the standard deviation that the measurement
  /// explains; NaN where it is not measured. Empty: not computed.
  Image<float> strain, strain_sigma;
  bool gutter_at_left = false;   ///< the left end of the grid is the book's gutter: the page ends there
  bool gutter_at_right = false;  ///< likewise the right end
  double turned_rad = 0;         ///< by how much a sheet that lay askew was turned back; clockwise is positive

  int columns() const { return model.width(); }
  int rows() const { return model.height(); }
  double s_of(double i) const { return s0_mm + i * spacing_mm; }
  double t_of(double j) const { return t0_mm + j * spacing_mm; }
};

/// Surface point at paper (s, t), by bicubic (Catmull-Rom) interpolation of `nodes`, which is surface.model or
/// surface.measured; linear extrapolation outside the grid.
/// \return [mm] rig frame
Eigen::Vector3d interpolate(const PageSurface& surface, const Image<Eigen::Vector3f>& nodes, double s_mm, double t_mm);

/// How well a flattening fits the sheet that was measured.
struct StrainSummary {
  double rms = 0;                ///< relative, of the measured nodes
  double unexplained_share = 0;  ///< of them: strained by more than 0.05 % and four standard deviations. Such paper is
                                 ///< damaged, wet or not paper, or something is wrong.
};
/// \return  zeros if no strain was computed
StrainSummary summarise_strain(const PageSurface& surface);

/// Share of the nodes that are covered by what is not the paper.
double covered_share(const PageSurface& surface);

}  // namespace pagesweep
