// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "pagesweep/data/page_surface.h"
#include "pagesweep/surfacing/differences.h"
#include "pagesweep/surfacing/flatten.h"
#include "pagesweep/surfacing/ruled_surface.h"

namespace pagesweep {

/// Arc length along the page's cut halfway up, from ruling alpha = 0.
class CutLength {
 public:
  /// \param from, to  range of alpha that is tabulated; beyond it the cut is straight
  CutLength(const RuledSurface& surface, double from, double to);
  double length_at(double alpha) const;
  double alpha_at(double length_mm) const;

 private:
  struct Place {
    double length_mm, slope;  // slope: d length / d x
  };
  Place place(std::size_t k, double x) const;  // within step k, 0 <= x <= 1

  double from_ = 0, step_ = 1;
  std::vector<double> lengths_, speeds_;  // at from_ + k step_; speed: d length / d alpha
};

/// Which end of a page is the gutter.
enum class GutterSide { none, left, right };

/// By how much the measured sheet is longer than its flattening, around the nodes of a grid.
struct Strain {
  Image<float> relative;  ///< mean over the edges at a node, measured length over flat length, minus 1; NaN: unmeasured
  Image<float> sigma;     ///< one standard deviation that follows from the heights' own
  /// Share of the measured nodes that are strained by more than `least`, and by more than the measurement explains.
  double share_beyond(double least) const;
};

/// A page's model surface and its flattening, as functions.
class FlatPage {
 public:
  /// \param places      the page's measured places: the grid covers them and a margin
  /// \param straighten  whether a page without a gutter that lies askew is to stand upright
  FlatPage(const RuledSurface& model, const Differences& differences, std::span<const Support> places,
           GutterSide gutter, bool straighten);
  /// Takes the measured surface itself for the model: it is laid flat anew, with the least stretching.
  /// \param differences  of that surface from the model; kept as a reference
  void follow_measurement(const Differences& differences);

  /// The page on a regular grid of paper coordinates, fine enough that interpolation errs by less than 0.01 mm.
  PageSurface sample(const PlanFrame& frame) const;
  const Distortion& distortion() const { return distortion_; }
  const Strain& strain() const { return strain_; }

 private:
  // Places on the model: those of a column of the grid share alpha, those of a row b.
  double alpha_of(double i) const { return cut_.alpha_at(length0_ + i * length_step_); }
  double b_of(double j) const { return b0_ + j * b_step_; }
  std::vector<double> alphas_of(int columns, int finer) const;
  Eigen::Vector3d above(double alpha, double b) const;
  Eigen::Vector3d surface_point(double alpha, double b) const;
  void set_nodes(double spacing_mm);
  void measure_strain();
  void lay_flat(const Image<Eigen::Vector2d>& start);
  Eigen::Vector2d paper_at(const Eigen::Vector2d& plan) const;
  void turn_upright();
  void find_outline();
  Eigen::Vector2d node_at(const Eigen::Vector2d& paper, Eigen::Vector2d guess) const;
  template <class Use>
  void for_each_node(const PageSurface& page, const Use& use) const;
  PageSurface empty_page(double spacing_mm) const;  // its model has its size
  double interpolation_error(double spacing_mm) const;
  double fine_enough_spacing() const;
  bool is_measured(const Eigen::Vector3d& point) const;
  float cover_above(const Eigen::Vector3d& measured) const;
  void look_up_status(const Eigen::Vector3d& measured, double normal_z, float& sigma, PixelStatus& status) const;

  const RuledSurface& model_;
  const Differences* differences_;
  std::vector<Eigen::Vector2d> places_;
  GutterSide gutter_;
  bool straighten_;
  double turned_rad_ = 0;
  CutLength cut_;
  double length0_ = 0, length1_ = 0, length_step_ = 1, b0_ = 0, b1_ = 0, b_step_ = 1;
  int columns_ = 0, rows_ = 0;
  double spacing_mm_ = 2;
  bool follows_ = false;
  Image<Eigen::Vector2d> flat_;             ///< [mm] paper (s, t) of each node
  Eigen::Vector2d low_{0, 0}, high_{0, 0};  ///< [mm] paper coordinates that the grid covers
  Distortion distortion_;
  Strain strain_;
};

}  // namespace pagesweep
