// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "pagesweep/camera/light.h"
#include "pagesweep/data/pixel_set.h"
#include "pagesweep/data/point_map.h"
#include "pagesweep/data/time_map.h"

namespace pagesweep {

/// The sheet of light as the stereo points of one scan show it.
struct LightSweep {
  Light light;                   ///< RecordedPlanes, one a frame
  double mm_per_frame = 0;       ///< mean speed over the table, along the sweep
  double unevenness_rms_mm = 0;  ///< of the stripe's way from an even motion
  double unevenness_max_mm = 0;  ///< largest
  double misfit_mm = 0;          ///< of the points from the plane of their time, perpendicular: median * 1.48
  std::int64_t points = 0;       ///< that took part
};

/// Fits the plane of every frame to the points: e . X + a(t) f . X + b(t) z = d(t) with e the direction of the sweep
/// over the table, f across it, a and b straight lines in time (the sheet may turn evenly) and d a cubic B-spline with
/// a knot every four frames (a motor is not even). Robust, weighted by the points' sigma; the tilt b, which flat paper
/// does not show, is held near upright where nothing speaks against it. See docs/derivations/fusion.md.
class LightCalibration {
 public:
  /// \param pixels  of all cameras together
  explicit LightCalibration(std::size_t pixels);

  /// Some of these points will take part.
  /// \param only  null: all
  /// \throws std::invalid_argument  if points and times differ in size
  void add(const PointMap& points, const TimeMap& times, const PixelSet* only = nullptr);
  /// The fit to all points so far; nothing if there are fewer than 1000 or they cover fewer than ten frames.
  std::optional<LightSweep> fit();
  /// Whether so many points have come since the last fit that the next one can be another: a hundredth.
  bool has_news() const { return 100 * (sightings_.size() - fitted_) > sightings_.size(); }

 private:
  struct Sighting {
    Eigen::Vector3f point;  ///< [mm] rig frame
    float time;             ///< [frames]
    float weight;           ///< [1/mm^2]
  };
  std::size_t stride_;  ///< [pixels]
  std::vector<Sighting> sightings_;
  std::size_t fitted_ = 0;  ///< how many there were at the last fit
};

/// The fit to all points of all cameras.
/// \throws std::invalid_argument  if points and times differ in number or size
std::optional<LightSweep> calibrate_light(std::span<const PointMap> points, std::span<const TimeMap> times);

}  // namespace pagesweep
