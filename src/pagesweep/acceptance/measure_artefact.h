// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "pagesweep/acceptance/find_plate.h"
#include "pagesweep/acceptance/seen_points.h"
#include "pagesweep/acceptance/shapes.h"
#include "pagesweep/base/image.h"
#include "pagesweep/io/artefact_file.h"

namespace pagesweep {

struct AcceptanceOptions {
  double cap_deg = 55;
  double plate_edge_mm = 3;
  double reach_mm = 3;
  double discarded_share = 0.003;

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("cap", cap_deg, "degrees",
          "a sphere is judged where its surface is inclined by less to the viewing rays of all cameras");
    visit("plate-edge", plate_edge_mm, "mm", "width of the plate's rim that is not judged");
    visit("reach", reach_mm, "mm", "points farther away from plate or sphere are of something else; they are counted");
    visit("discard", discarded_share, "",
          "share of the points that is discarded as outliers; the guideline permits up to 0.003");
  }
};

/// Distances of points to the shape that was fitted to them.
struct Deviations {
  static constexpr double none = std::numeric_limits<double>::quiet_NaN();
  std::size_t points = 0;        ///< all that were judged, those discarded from the range included
  std::size_t discarded = 0;     ///< those farthest away
  std::size_t far_points = 0;    ///< beyond the reach: of something else, or gross errors; in no other figure
  double range_mm = none;        ///< largest minus smallest signed distance, without the discarded points
  double full_range_mm = none;   ///< with them
  double rms_mm = none;          ///< of all points
  double claimed_rms_mm = none;  ///< that the points' own standard deviations predict, perpendicular to the shape

  double rms_over_claim() const { return rms_mm / claimed_rms_mm; }
};

struct PlateResult {
  Plate plate;
  Deviations deviations;  ///< range_mm is the flatness measurement error
  Image<float> map;       ///< [mm] mean deviation, towards the cameras positive; the longer side to the right
};

struct SphereResult {
  Sphere sphere;
  double calibrated_diameter_mm = 0;
  Deviations deviations;  ///< range_mm is the probing error form
  Image<float> map;       ///< [mm] mean deviation, outwards positive; seen from the cameras

  /// Probing error size: measured minus calibrated diameter.
  double size_error_mm() const { return 2 * sphere.radius_mm - calibrated_diameter_mm; }
};

struct SpacingResult {
  double measured_mm = 0;
  double calibrated_mm = 0;
  double noise_mm = 0;  ///< standard deviation of the measured spacing by the points' noise alone

  double error_mm() const { return measured_mm - calibrated_mm; }
};

/// What one pose showed of an artefact. What is missing has a reason, or is not part of the artefact.
struct PoseResult {
  std::string name;
  std::optional<PlateResult> plate;
  std::string plate_reason;
  std::vector<SphereResult> spheres;  ///< all of the artefact's, or none
  std::string spheres_reason;
  std::optional<SpacingResult> spacing;
};

/// Finds the artefact's parts among the measured points and determines the quality parameters of VDI/VDE 2634 part 2
/// (docs/acceptance.md).
///
/// Which points belong to a part is decided by where their viewing ray meets it, not by where they lie: a bad
/// point is not left out for being bad. Plate and spheres are fitted by least squares, all points alike.
/// \throws std::invalid_argument  if an option is out of its range
/// \throws Error  (no_result) if the pose shows nothing of the artefact
PoseResult measure_artefact(const ArtefactPose& pose, const Artefact& artefact, const AcceptanceOptions& options = {});

}  // namespace pagesweep
