// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "pagesweep/base/progress.h"
#include "pagesweep/camera/ray_table.h"
#include "pagesweep/data/pixel_set.h"
#include "pagesweep/matching/time_matching.h"
#include "pagesweep/pipeline/scan_page.h"

namespace pagesweep {

/// The way from two cameras' times to points while the stripe is still on its way.
///
/// Each pixel goes from step to step when what it needs of its surroundings has come that far: its time is corrected
/// for print, matched, confirmed, fused with the sheet of light, given a normal. Gain of the correction, range of
/// depths and sheet of light are learned from all parts so far. All that is decided follows from the frames, not from
/// the clock, so a recording gives what the live sweep gave; with all times at once, it is the way from station to
/// station. docs/derivations/streaming.md has the order of the steps and how far each stays behind.
class PointStream {
 public:
  using Times = std::array<const TimeMap*, 2>;

  /// The steps that not everybody wants.
  struct Steps {
    bool corrects_edges;  ///< by the amplitudes
    bool fits_normals;
  };

  /// \param cameras  two, which outlive this, as do the options
  PointStream(const std::vector<RayTable>& cameras, const ScanOptions& options, const Steps& steps);

  /// Goes as far as the times that are known allow, if that is news.
  /// \param known_until  [frames] pixels of both cameras that the stripe passed before have their times
  void follow(const Times& seen, double known_until);
  /// A camera's points so far, without intensities; those that the sheet of light has had no say in yet may still move
  /// a little.
  const PointMap& so_far(std::size_t camera) const { return sides_[camera].points; }

  /// Goes the rest of the way with all times. Once, at the end. What was estimated otherwise since is done again.
  /// \return what there is to know; of `timing`, only the maps, and these only where edges were corrected
  void finish(const Times& seen, Measurement& measurement, Progress& progress = no_progress());

 private:
  /// How far a pixel has come.
  enum Step : std::uint8_t { none, timed, matched, located, fused, finished };
  /// One camera's part of it.
  struct Side {
    TimeMap corrected;   ///< empty if edges are not; without residuals, until the end
    Image<float> taken;  ///< [frames] the times that were seen
    Image<std::uint8_t> step;
    PixelSet now;     ///< that take the next step
    PointMap points;  ///< without intensities, and normals that nobody wants, until the end
    EdgeFit edges;
    EdgeCorrection correction;
    FusionCounts fusion;
  };

  void go_on(const Times& seen, double until, Progress& progress);
  void take_times(const Times& seen, double until);
  /// Of pixels that never had a time, only the reason is known.
  void leave_dark(const TimeMap& seen, Side& side);
  void correct(const TimeMap& seen, Side& side);
  void locate(double until);
  void fuse(double until);
  void fit_normals(double until);
  /// Selects the pixels that have come as far as `from` and whose time lies before `until`, and lets them step on.
  /// \return whether there are any
  bool step_on(Step from, double until);
  bool step_on(Side& side, const TimeMap& times, Step from, double until);
  /// Lets pixels whose time has changed begin again, and those around them and around their matches.
  void forget_changed(const Times& seen);
  void forget(Side& side, int x, int y, int reach);
  const TimeMap& times(std::size_t c) const { return steps_.corrects_edges ? sides_[c].corrected : *seen_[c]; }
  PixelSets now() const { return {&sides_[0].now, &sides_[1].now}; }

  const std::vector<RayTable>& cameras_;
  const ScanOptions& options_;
  Steps steps_;
  Times seen_{};
  double frames_a_pixel_ = 0;
  double known_until_, done_until_;  ///< [frames]
  std::array<Side, 2> sides_;
  TimeMatching matching_;
  LightCalibration calibration_;
  std::optional<LightSweep> sweep_;
};

}  // namespace pagesweep
