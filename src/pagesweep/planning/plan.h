// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/camera/rig.h"
#include "pagesweep/planning/plan_point.h"
#include "pagesweep/planning/plan_time.h"

namespace pagesweep {

/// The part of the table that is to be measured, its sides along x and y.
struct TableExtent {
  double width_mm = 420;
  double depth_mm = 297;
  double center_x_mm = 0;  ///< rig frame
  double center_y_mm = 0;
};

/// "A5" to "A2" lying on their long side, "420x297" (x and y in mm), "420x297+10-20" (likewise, its middle at x = 10,
/// y = -20); nothing if it is none of these.
std::optional<TableExtent> extent_named(std::string_view text);

/// A sheet of light at right angles to the table that moves along y, a millimetre a frame.
Light upright_light();

/// What is to be planned.
struct PlanRequest {
  std::vector<Camera> cameras;  ///< one or two
  Light light = upright_light();
  double mm_per_frame = 0;  ///< speed of the light on the table's middle; 0: as the light has it
  RecordingPlan recording;
  TableExtent table;
  std::vector<double> heights_mm = {0, 30, 60};  ///< of the paper above the table
  double grid_mm = 5;
};

/// How fast the stripe runs over the table at a place of z = 0 [mm/frame]; NaN if it never comes there.
double speed_on_table(const Light& light, const Eigen::Vector3d& place);

/// Middle and worst of the spots that can be measured; NaN if there are none.
struct Spread {
  double median = SpotAccuracy::missing;
  double worst = SpotAccuracy::missing;
};

/// The table at one height of the paper. Images have their first row at the largest y, as seen from above.
struct HeightPlan {
  double height_mm = 0;
  Image<std::uint8_t> cameras;  ///< how many see the spot
  Image<SpotAccuracy> spots;    ///< root mean squares over the cameras that see it; section: the better one
  /// Values of a field of SpotAccuracy, or of the height z that belongs to it.
  Image<float> map_of(double SpotAccuracy::* field) const;
  Image<float> height_map_of(double SpotAccuracy::* field) const;  ///< [mm]
  /// Share of the spots that so many cameras see.
  double share_seen_by(int count) const;
};

/// Another rig, and what it would change.
struct Variation {
  std::string name;                      ///< key for scripts: "stripe_half"
  std::string what;                      ///< "stripe 6 mm wide"
  double ratio = SpotAccuracy::missing;  ///< of its median height error to that of the plan; infinity: not measurable
};

struct Plan {
  PlanRequest request;
  double mm_per_frame = 0;                     ///< on the table
  double stripe_frames = 0;                    ///< full width at half maximum of the bell, without exposure
  double baseline_mm = SpotAccuracy::missing;  ///< distance of the two cameras
  TimeVariance time;                           ///< [frames^2]
  std::vector<HeightPlan> heights;
  std::vector<Variation> variations;
  double best_stripe_mm = 0;     ///< see best_stripe_mm()
  double best_stripe_ratio = 0;  ///< of its height error to that of the plan

  double time_sigma() const;  ///< [frames]
  /// How the points are measured that `spread` tells of: stereo where there are two cameras, else light sections.
  double SpotAccuracy::* method() const;
};

/// Median and worst of a field over all heights; of its height z if `as_height`.
Spread spread_of(const std::vector<HeightPlan>& heights, double SpotAccuracy::* field, bool as_height);

/// Predicts what a rig will measure, before it is built: Cramér-Rao bound of the time values, and what it becomes in
/// matches and points of level paper over the table. Amplitude and stripe width are taken to be the same everywhere.
/// \throws std::invalid_argument  if a number cannot be meant, or there are no cameras or more than two
/// \throws Error                  if no camera sees the stripe on the table
Plan make_plan(const PlanRequest& request);

/// The same cameras, `factor` times as far apart, each turned so that its optical axis meets the table where it did.
std::vector<Camera> spread_cameras(const std::vector<Camera>& cameras, double factor);

}  // namespace pagesweep
