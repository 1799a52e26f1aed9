// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "pagesweep/camera/camera.h"
#include "pagesweep/data/point_map.h"
#include "pagesweep/evaluation/local_fit.h"
#include "pagesweep/evaluation/statistics.h"

namespace pagesweep {

/// For each pixel of a camera, the rig-frame point [mm] that its centre's ray hits; NaN where it hits no page.
using TruePoints = Image<Eigen::Vector3f>;

inline constexpr std::size_t status_count = names_of(PixelStatus{}).size();

struct PointComparisonOptions {
  double same_point_mm = 0.5;
  double neighbourhood_mm = 5;
  LocalFit local_fit = LocalFit::plane;
  int fit_step_px = 3;

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("same-point", same_point_mm, "mm", "two cameras see the same spot of page if their true points are closer");
    visit("neighbourhood", neighbourhood_mm, "mm", "diameter of the neighbourhood of a local fit");
    visit("local-fit", local_fit, "", "surface that is fitted to each neighbourhood");
    visit("fit-step", fit_step_px, "px", "a local fit is made at every so-many-th pixel");
  }
};

/// One camera's measured points and what they should be.
struct MeasuredView {
  const Camera* camera = nullptr;
  const PointMap* points = nullptr;
  const TruePoints* truth = nullptr;
};

/// How the points of one camera, or of all, agree with the true surface. Page pixels only, but for false_points.
struct PointErrors {
  ErrorSummary distance;    ///< [mm] perpendicular to the true surface, positive towards the camera
  ErrorSummary along_ray;   ///< [mm] along the viewing ray, positive towards the camera
  ErrorSummary normalised;  ///< along_ray over the standard deviation that the point claims: rms 1 if it claims right
  ErrorSummary fitted;      ///< [mm] perpendicular distance of local fits to the true surface
  double claimed_rms = ErrorSummary::none;  ///< [mm] rms of `distance` that the claimed standard deviations predict

  std::size_t page_pixels = 0;   ///< their centre's ray hits a page
  std::size_t measured = 0;      ///< page pixels with status ok
  std::size_t seen_by_both = 0;  ///< page pixels whose true point is seen by another camera too
  std::size_t measured_of_both = 0;
  std::size_t false_points = 0;                     ///< status ok, but the ray hits no page
  std::array<std::size_t, status_count> missing{};  ///< of the pixels seen by both that are not ok, by status

  /// rms of the distances over what the points claim; NaN if there are none.
  double error_over_claim() const { return distance.rms / claimed_rms; }
  double completeness() const;      ///< measured share of the pixels seen by both, NaN if there are none
  double measured_of_page() const;  ///< measured share of all page pixels
};

struct PointComparison {
  std::vector<PointErrors> cameras;      ///< in the order given
  PointErrors all;                       ///< all cameras' pixels together
  std::vector<Image<float>> error_maps;  ///< [mm] perpendicular distance per camera, NaN where there is none
};

/// Compares points pixel by pixel.
///
/// The true surface at a pixel is the plane through its true point and the neighbouring ones. Whether another camera
/// sees a true point is found by projecting it there and looking up the true point at that place.
/// \throws std::invalid_argument  if a view is incomplete or its sizes differ
PointComparison compare_points(std::span<const MeasuredView> views, const PointComparisonOptions& options = {});

/// The same for a cloud of points of which nobody knows the pixel: each is looked up in the camera in which it comes
/// closer to the true surface. Points that meet a page in no camera are `false_points`; completeness is not known.
/// \param sigma  [mm] what each point claims along its ray; empty: nothing
/// \param views  `points` is not used
PointErrors compare_cloud(std::span<const Eigen::Vector3f> cloud, std::span<const float> sigma,
                          std::span<const MeasuredView> views);

/// Unit normal of the true surface at a pixel, on the camera's side; NaN where the neighbours do not tell.
Eigen::Vector3d true_normal(const TruePoints& truth, int x, int y, const Eigen::Vector3d& camera_center);

}  // namespace pagesweep
