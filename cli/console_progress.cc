// SPDX-License-Identifier: Apache-2.0
#include "cli/console_progress.h"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "cli/interrupt.h"

namespace pagesweep::cli {

ConsoleProgress::ConsoleProgress(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0) {}

ConsoleProgress::~ConsoleProgress() { finish(); }

void ConsoleProgress::begin(std::string_view step) {
  throw_if_interrupted();
  const std::lock_guard lock(mutex_);
  end_step();
  step_ = step;
  begun_ = std::chrono::steady_clock::now();
  if (quiet_) return;
  if (terminal_)
    draw(0);
  else
    fmt::print(stderr, "{}\n", step_);
}

void ConsoleProgress::advance(double share) {
  throw_if_interrupted();
  const std::lock_guard lock(mutex_);
  if (!quiet_ && terminal_ && !step_.empty()) draw(share);
}

void ConsoleProgress::warn(std::string_view message) {
  const std::lock_guard lock(mutex_);
  warnings_.emplace_back(message);
  if (quiet_) return;
  if (terminal_) fmt::print(stderr, "\r\x1b[K");
  fmt::print(stderr, "warning: {}\n", message);
  drawn_percent_ = -1;
}

void ConsoleProgress::finish() {
  const std::lock_guard lock(mutex_);
  end_step();
}

void ConsoleProgress::draw(double share) {
  constexpr int bar_width = 30;
  const int percent = static_cast<int>(std::lround(100 * std::clamp(share, 0.0, 1.0)));
  if (percent == drawn_percent_) return;
  drawn_percent_ = percent;
  const int filled = percent * bar_width / 100;
  fmt::print(stderr, "\r{:40} {:#<{}}{:.<{}} {:3} %\x1b[K", step_, "", filled, "", bar_width - filled, percent);
  std::fflush(stderr);
}

void ConsoleProgress::end_step() {
  if (step_.empty()) return;
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begun_;
  times_.push_back({step_, elapsed.count()});
  if (terminal_ && !quiet_) fmt::print(stderr, "\r{:40} {:.1f} s\x1b[K\n", step_, elapsed.count());
  step_.clear();
  drawn_percent_ = -1;
}

}  // namespace pagesweep::cli
