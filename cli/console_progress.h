// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <mutex>
#include <string>
#include <vector>

#include "pagesweep/base/progress.h"
#include "pagesweep/report/report.h"

namespace pagesweep::cli {

/// Tells on stderr what the library does: a bar that moves on a terminal, one line a step elsewhere. Also the place
/// where a run notices that it was interrupted.
class ConsoleProgress : public Progress {
 public:
  explicit ConsoleProgress(bool quiet);
  ~ConsoleProgress() override;

  void begin(std::string_view step) override;
  void advance(double share) override;
  void warn(std::string_view message) override;
  /// Ends the last step's line.
  void finish();

  const std::vector<std::string>& warnings() const { return warnings_; }
  /// How long each step took that has ended.
  const std::vector<StationTime>& times() const { return times_; }

 private:
  void draw(double share);
  void end_step();

  std::mutex mutex_;
  bool quiet_;
  bool terminal_;
  std::string step_;  ///< the one in progress; empty: none
  std::chrono::steady_clock::time_point begun_;
  int drawn_percent_ = -1;
  std::vector<std::string> warnings_;
  std::vector<StationTime> times_;
};

}  // namespace pagesweep::cli
