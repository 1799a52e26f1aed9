// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "pagesweep/data/point_map.h"
#include "pagesweep/live/live_source.h"

namespace pagesweep::cli {

/// Shows a running sweep on stderr: both cameras' rates and losses, where the stripe is, and what it has left behind.
/// On a terminal it is redrawn in place; elsewhere a line tells each change of state and one a second how it goes.
class LiveView {
 public:
  explicit LiveView(bool quiet);
  ~LiveView();

  void show(const LiveStatus& status);
  /// The surface so far, as one camera sees it.
  void show(const PointMap& points);
  /// Takes the picture off the terminal, for others to write.
  void clear();
  /// Tells something at once.
  void warn(const std::string& remark);
  /// Says how it went.
  void finish(const LiveStatus& status);
  /// Everything that the operator was warned of.
  const std::vector<std::string>& remarks() const { return remarks_; }

 private:
  void draw(const LiveStatus& status);

  bool quiet_, terminal_;
  int lines_drawn_ = 0;
  std::optional<SweepWatch::State> state_;
  std::chrono::steady_clock::time_point last_line_;
  std::chrono::steady_clock::time_point last_relief_;
  std::vector<std::string> relief_;  ///< the surface in letters, higher ones brighter
  std::vector<std::string> passed_;  ///< rows of a small picture of each camera: where the stripe has been
  std::vector<std::string> remarks_;
};

/// "100.0 frames/s, 812 frames, 3 damaged, 1 lost": what became of a camera's frames.
std::string describe(const LiveStatus::Camera& camera);

}  // namespace pagesweep::cli
