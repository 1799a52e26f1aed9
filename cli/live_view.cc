// SPDX-License-Identifier: Apache-2.0
#include "cli/live_view.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

#include "cli/interrupt.h"
#include "pagesweep/live/letter_relief.h"

namespace pagesweep::cli {
namespace {

constexpr int bar_length = 40;
constexpr int relief_columns = 56, relief_rows = 16;
constexpr auto between_reliefs = std::chrono::milliseconds(300);

std::string_view describe(SweepWatch::State state) {
  switch (state) {
    case SweepWatch::State::waiting:
      return "waiting for the stripe of light";
    case SweepWatch::State::sweeping:
      return "the stripe is passing";
    case SweepWatch::State::over:
      break;
  }
  return "the stripe has left";
}

}  // namespace

std::string describe(const LiveStatus::Camera& camera) {
  const FrameCounts& counts = camera.counts;
  std::string text = fmt::format("{}: {:.1f} frames/s, {} frames", camera.name, camera.rate_hz, counts.received);
  if (counts.damaged > 0) text += fmt::format(", {} damaged", counts.damaged);
  if (counts.lost > 0) text += fmt::format(", {} lost", counts.lost);
  if (counts.unpaired > 0) text += fmt::format(", {} without a partner", counts.unpaired);
  if (counts.late > 0) text += fmt::format(", {} too late", counts.late);
  return text;
}

LiveView::LiveView(bool quiet) : quiet_(quiet), terminal_(!quiet && isatty(STDERR_FILENO) != 0) {}

LiveView::~LiveView() { clear(); }

void LiveView::clear() {
  if (terminal_ && lines_drawn_ > 0) fmt::print(stderr, "\x1b[{}F\x1b[J", lines_drawn_);
  lines_drawn_ = 0;
}

void LiveView::warn(const std::string& remark) {
  clear();
  remarks_.push_back(remark);
  if (!quiet_) fmt::print(stderr, "  {}\n", remark);
}

void LiveView::draw(const LiveStatus& status) {
  passed_.resize(status.cameras.size(), std::string(bar_length, '.'));
  fmt::print(stderr, "{}, {} frames\n", describe(status.state), status.frames);
  for (std::size_t c = 0; c < status.cameras.size(); ++c) {
    std::string bar = passed_[c];
    if (const auto stripe = status.cameras[c].stripe) {
      const int at = std::clamp(static_cast<int>(stripe->y * bar_length), 0, bar_length - 1);
      std::fill_n(passed_[c].begin() + at, 1, '=');
      bar = passed_[c];
      bar[static_cast<std::size_t>(at)] = '#';
    }
    fmt::print(stderr, "  [{}] {}\n", bar, cli::describe(status.cameras[c]));
  }
  for (const std::string& row : relief_) fmt::print(stderr, "  {}\n", row);
  lines_drawn_ = 1 + static_cast<int>(status.cameras.size() + relief_.size());
}

void LiveView::show(const LiveStatus& status) {
  throw_if_interrupted();
  clear();
  for (const std::string& remark : status.remarks) warn(remark);
  if (quiet_) return;
  const auto now = std::chrono::steady_clock::now();
  if (terminal_) {
    draw(status);
  } else if (state_ != status.state || now - last_line_ > std::chrono::seconds(1)) {
    fmt::print(stderr, "{}", describe(status.state));
    for (const auto& camera : status.cameras) {
      fmt::print(stderr, "; {}", cli::describe(camera));
      if (camera.stripe) fmt::print(stderr, ", stripe at {:.0f} %", 100 * camera.stripe->y);
    }
    fmt::print(stderr, "\n");
    last_line_ = now;
  }
  state_ = status.state;
}

void LiveView::show(const PointMap& points) {
  const auto now = std::chrono::steady_clock::now();
  if (!terminal_ || now - last_relief_ < between_reliefs) return;
  last_relief_ = now;
  relief_ = letter_relief(points, relief_columns, relief_rows);
}

void LiveView::finish(const LiveStatus& status) {
  clear();
  for (const std::string& remark : status.remarks) warn(remark);
  if (quiet_) return;
  for (const auto& camera : status.cameras) fmt::print(stderr, "{}\n", cli::describe(camera));
}

}  // namespace pagesweep::cli
