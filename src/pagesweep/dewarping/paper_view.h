// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "pagesweep/base/image.h"
#include "pagesweep/camera/scanner.h"
#include "pagesweep/data/page_surface.h"

namespace pagesweep {

/// By how much a spot of paper is displaced in the scan because the page is not where the model says:
///     Delta = G(x, y, z) - G(x', y', z')
/// with G the scanner's picture, (x, y, z) on the model and (x', y', z') the measurement orthogonally above it
/// (Lilienblum et al. 2009, eq. 12). The spot is found at G(x, y, z) - Delta.
/// \return [px] in the scan; nothing if one of the points is never seen
std::optional<Eigen::Vector2d> difference_vector(const Scanner& scanner, const Eigen::Vector3d& model_mm,
                                                 const Eigen::Vector3d& measured_mm);

/// Which of a PageSurface's two shapes is looked at.
enum class PaperShape { model, measured };

/// How the scanner sees the paper of one page: paper (s, t) -> scan (u, v). Keeps references to both.
class PaperView {
 public:
  PaperView(const PageSurface& surface, const Scanner& scanner, PaperShape shape);

  const PageSurface& surface() const { return *surface_; }
  const Scanner& scanner() const { return *scanner_; }
  PaperShape shape() const { return shape_; }
  /// The paper's nodes in that shape [mm].
  const Image<Eigen::Vector3f>& nodes() const;
  /// The spot in the rig frame [mm].
  Eigen::Vector3d point(const Eigen::Vector2d& paper_mm) const;
  /// Where the spot is imaged [px], inside the scan or not, hidden or not. With the measured shape this is eq. 12 done:
  /// G(model) - Delta = G(measured).
  std::optional<Eigen::Vector2d> position(const Eigen::Vector2d& paper_mm) const;
  /// Whether the spot is part of this page: paper ends at the gutter, other sides are left to the outline.
  bool is_on_page(const Eigen::Vector2d& paper_mm) const;

 private:
  const PageSurface* surface_;
  const Scanner* scanner_;
  PaperShape shape_;
};

/// Which spots the scanner cannot see because paper of the same or another page lies in front of them: a depth buffer
/// over the scan. Near steep gutters a page may hide part of its neighbour or of itself.
class Occlusion {
 public:
  /// Nothing hides anything.
  Occlusion() = default;
  explicit Occlusion(std::span<const PaperView> pages);
  /// \param pixel  where `point` is imaged
  bool hides(const Scanner& scanner, const Eigen::Vector3d& point_mm, const Eigen::Vector2d& pixel) const;

 private:
  struct Corner;
  void add(const PaperView& page);
  void add_triangle(const Corner& a, const Corner& b, const Corner& c);

  Image<float> nearest_, farthest_;  ///< [mm] along the viewing rays; a cell is 4 x 4 scan pixels
};

}  // namespace pagesweep
