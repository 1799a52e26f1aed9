// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/time_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>

#include "pagesweep/base/parallel.h"
#include "pagesweep/timing/learn_profile.h"
#include "pagesweep/timing/recorded_times_internal.h"

namespace pagesweep {
namespace {

/// [frames] Fewer and every pixel's search is taken up and laid down more often; more and more frames are kept.
constexpr int frames_a_step = 8;

}  // namespace

/// What there is once the stripe is known.
struct TimeStream::Learned {
  LearnedStripe stripe;
  std::deque<std::optional<RecordedTimes>> cameras;  ///< none any more when it is done
};

TimeStream::TimeStream(const std::vector<Sequence>& sequences, const TimingOptions& options)
    : options_(options),
      arrived_(sequences.size(), 0),
      next_lesson_(next_lesson(0)),
      learner_(std::make_unique<StripeLearner>()) {
  if (sequences.empty()) throw std::invalid_argument("TimeStream: at least one camera is needed");
  for (const Sequence& sequence : sequences) frames_.emplace_back(sequence);
  follows_ = std::ranges::all_of(
      sequences, [&](const Sequence& sequence) { return RecordedTimes::can_estimate(sequence, options); });
}

TimeStream::TimeStream(TimeStream&&) noexcept = default;
TimeStream::~TimeStream() = default;

void TimeStream::add(FrameSet set) {
  // Once a frame comes, the lesson before it cannot be the last: whether more would come was not known then.
  while (follows_ && !learned_ && next_lesson_ <= set.index)
    learn(std::exchange(next_lesson_, next_lesson(next_lesson_)));
  for (std::size_t c = 0; c < frames_.size(); ++c) {
    if (!set.images[c]) continue;
    frames_[c].set(set.index, *std::move(set.images[c]), set.late_of(c));
    ++arrived_[c];
  }
  if (!follows_) return;
  const int end = set.index + 1;
  if (!learned_ || end - looked_at_ < frames_a_step) return;
  parallel_rows(static_cast<int>(frames_.size()), [&](int c) { look(static_cast<std::size_t>(c), end); });
  looked_at_ = end;
}

void TimeStream::learn(int end) {
  auto stripe = learner_->learn(frames_, end);
  if (!stripe) return;
  learner_.reset();
  learned_ = std::make_unique<Learned>(Learned{*std::move(stripe), {}});
  // One camera's frames make room for the next one's windows.
  for (std::size_t c = 0; c < frames_.size(); ++c) {
    follow_camera(c);
    look(c, end);
  }
  looked_at_ = end;
}

void TimeStream::follow_camera(std::size_t c) {
  const LearnedStripe& stripe = learned_->stripe;
  learned_->cameras.emplace_back(std::in_place, frames_[c].sequence(), stripe.profile, stripe.noise[c], options_);
}

void TimeStream::look(std::size_t c, int end) {
  RecordedTimes& times = *learned_->cameras[c];
  Frames& frames = frames_[c];
  times.look(frames, std::min(end, frames.count()));
  // The last frame before what is needed may stand for a dropped one.
  int kept = times.first_needed();
  while (kept > 0 && !frames.has(kept)) --kept;
  for (int i = 0; i < kept; ++i) frames.forget(i);
}

double TimeStream::known_until() const {
  if (!learned_) return -std::numeric_limits<double>::infinity();
  double until = std::numeric_limits<double>::infinity();
  for (const auto& camera : learned_->cameras) until = std::min(until, camera->known_until());
  return until;
}

const TimeMap& TimeStream::so_far(std::size_t camera) const { return learned_->cameras[camera]->so_far(); }

Timing TimeStream::finish(Progress& progress, std::optional<int> count) {
  for (Frames& frames : frames_)
    if (count) frames.end_at(*count);
  for (std::size_t c = 0; c < frames_.size(); ++c)
    if (dropped_frames(c) > 0)
      progress.warn(fmt::format("{}: {} of {} frames were dropped", frames_[c].sequence().camera, dropped_frames(c),
                                frames_[c].count()));
  if (!follows_) return estimate_times(frames_, options_, progress);
  if (!learned_) learned_ = std::make_unique<Learned>(Learned{learner_->learn_from_all(frames_, next_lesson_), {}});
  Timing timing{learned_->stripe.profile, learned_->stripe.noise, {}, {}};
  for (std::size_t c = 0; c < frames_.size(); ++c) {
    if (c == learned_->cameras.size()) follow_camera(c);
    RecordedTimes& times = *learned_->cameras[c];
    times.finish(frames_[c]);
    for (int i = 0; i < frames_[c].count(); ++i) frames_[c].forget(i);
    timing.widths.push_back(std::move(times.widths()));
    timing.maps.push_back(std::move(times.map()));
    clipped_.push_back(std::move(times.clipped_frames()));
    learned_->cameras[c].reset();
  }
  learned_.reset();
  return timing;
}

int TimeStream::frames_kept() const {
  int kept = 0;
  for (const Frames& frames : frames_) kept += frames.count() - frames.dropped();
  return kept;
}

}  // namespace pagesweep
