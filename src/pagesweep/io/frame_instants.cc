// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "pagesweep/base/error.h"
#include "pagesweep/data/trigger_times.h"
#include "pagesweep/io/frame_instants_internal.h"

namespace pagesweep {
namespace {

constexpr int most_instants = 100'000;

/// What each camera's clock said of frame i.
std::vector<Timestamp> stamps_of(const Capture& capture, int i) {
  std::vector<Timestamp> stamps;
  for (const SequenceFiles& files : capture.sequences) {
    const auto k = static_cast<std::size_t>(i);
    const bool is_known = !files.timestamps_ns.empty() && files.timestamps_ns[k] != no_timestamp;
    stamps.push_back(is_known ? Timestamp(files.timestamps_ns[k]) : std::nullopt);
  }
  return stamps;
}

/// The first trigger that all cameras saw; one that none did if there is none.
std::vector<Timestamp> first_common(const Capture& capture) {
  for (int i = 0; i < capture.sequences[0].count; ++i) {
    auto stamps = stamps_of(capture, i);
    if (std::ranges::all_of(stamps, [](const Timestamp& stamp) { return stamp.has_value(); })) return stamps;
  }
  return std::vector<Timestamp>(capture.sequences.size());
}

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

}  // namespace

std::vector<Instant> instants_of(const Capture& capture) {
  const int count = capture.sequences.empty() ? 0 : capture.sequences[0].count;
  const bool has_times =
      std::ranges::any_of(capture.sequences, [](const SequenceFiles& files) { return !files.timestamps_ns.empty(); });
  if (!has_times) return one_after_the_other(count);
  TriggerTimes times(interval_of(capture), capture.is_triggered, first_common(capture));
  std::vector<Instant> instants;
  for (int i = 0; i < count; ++i) {
    const auto stamps = stamps_of(capture, i);
    if (std::ranges::none_of(stamps, [](const Timestamp& stamp) { return stamp.has_value(); })) continue;
    auto place = times.place(stamps);
    if (!place || place->index >= most_instants)
      throw bad_input(capture.folder / "capture.json", "sequences",
                      fmt::format("the \"timestamps_ns\" of frame {} do not follow those before: expected ascending "
                                  "times of one sweep, {} ns from one to the next",
                                  i, times.interval_ns()));
    while (static_cast<int>(instants.size()) < place->index) instants.push_back({static_cast<int>(instants.size())});
    instants.push_back({place->index, i, std::move(place->late)});
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
