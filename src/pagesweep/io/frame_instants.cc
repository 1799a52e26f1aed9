// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <optional>

#include "pagesweep/base/error.h"
#include "pagesweep/data/frame_beat.h"
#include "pagesweep/io/frame_instants_internal.h"

namespace pagesweep {
namespace {

constexpr int most_instants = 100'000;

/// The clocks of a capture's cameras.
class Clocks {
 public:
  explicit Clocks(const Capture& capture) : capture_(capture) {}

  std::optional<std::int64_t> stamp(std::size_t camera, int i) const {
    const auto& stamps = capture_.sequences[camera].timestamps_ns;
    if (stamps.empty() || stamps[static_cast<std::size_t>(i)] == no_timestamp) return std::nullopt;
    return stamps[static_cast<std::size_t>(i)];
  }
  /// When frame i was exposed by the first camera's clock; nothing if no camera tells.
  std::optional<std::int64_t> time_ns(int i) const {
    for (std::size_t c = 0; c < capture_.sequences.size(); ++c)
      if (const auto own = stamp(c, i)) return *own - (c == 0 || !capture_.is_triggered ? 0 : ahead_ns(c, i));
    return std::nullopt;
  }

 private:
  /// By how much a camera's clock is ahead of the first one's, from the nearest frame that both have.
  std::int64_t ahead_ns(std::size_t camera, int i) const {
    const int count = capture_.sequences[0].count;
    for (int distance = 1; distance < count; ++distance)
      for (const int near : {i - distance, i + distance}) {
        if (near < 0 || near >= count) continue;
        const auto first = stamp(0, near), own = stamp(camera, near);
        if (first && own) return *own - *first;
      }
    return 0;
  }

  const Capture& capture_;
};

double interval_of(const Capture& capture) {
  if (capture.frame_interval_ns > 0) return capture.frame_interval_ns;
  double shortest = 0;
  for (const SequenceFiles& files : capture.sequences) {
    std::vector<std::int64_t> stamps;
    std::ranges::remove_copy(files.timestamps_ns, std::back_inserter(stamps), no_timestamp);
    const double interval = usual_interval_ns(stamps);
    if (interval > 0 && (shortest == 0 || interval < shortest)) shortest = interval;
  }
  return shortest > 0 ? shortest : 1;
}

std::vector<Instant> one_after_the_other(int count) {
  std::vector<Instant> instants;
  for (int i = 0; i < count; ++i) instants.push_back({i, i});
  return instants;
}

/// How much later than the instant each camera's frame was exposed.
std::vector<float> late_frames(const Capture& capture, const Clocks& clocks, int i, const FrameBeat& beat,
                               const FrameBeat::Place& place) {
  std::vector<float> late(capture.sequences.size(), static_cast<float>(place.late));
  if (!capture.is_triggered)
    for (std::size_t c = 0; c < late.size(); ++c)
      if (const auto own = clocks.stamp(c, i)) late[c] = static_cast<float>(beat.time_of(*own) - place.index);
  if (std::ranges::all_of(late, [](float frames) { return frames == 0; })) return {};
  return late;
}

}  // namespace

std::vector<Instant> instants_of(const Capture& capture) {
  const int count = capture.sequences.empty() ? 0 : capture.sequences[0].count;
  const bool has_times =
      std::ranges::any_of(capture.sequences, [](const SequenceFiles& files) { return !files.timestamps_ns.empty(); });
  if (!has_times) return one_after_the_other(count);
  const Clocks clocks(capture);
  FrameBeat beat(interval_of(capture));
  std::vector<Instant> instants;
  for (int i = 0; i < count; ++i) {
    const auto time_ns = clocks.time_ns(i);
    if (!time_ns) continue;
    const auto place = beat.place(*time_ns);
    if (!place || place->index >= most_instants)
      throw bad_input(capture.folder / "capture.json", "sequences",
                      fmt::format("the \"timestamps_ns\" of frame {} do not follow those before: expected ascending "
                                  "times of one sweep, {} ns from one to the next",
                                  i, beat.interval_ns()));
    while (static_cast<int>(instants.size()) < place->index) instants.push_back({static_cast<int>(instants.size())});
    instants.push_back({place->index, i, late_frames(capture, clocks, i, beat, *place)});
  }
  return instants;
}

Sequence on_instants(Sequence sequence, const std::vector<Instant>& instants) {
  std::vector<double> exposures;
  for (const Instant& instant : instants)
    exposures.push_back(instant.number < 0 ? 1 : sequence.exposure(instant.number));
  if (!sequence.exposures.empty()) sequence.exposures = std::move(exposures);
  sequence.count = static_cast<int>(instants.size());
  return sequence;
}

}  // namespace pagesweep
