// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/live/record_capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

#include "pagesweep/base/error.h"
#include "pagesweep/io/recording_file.h"

namespace pagesweep {
namespace {

constexpr int most_frames = 100'000;

struct Waiting {
  FrameSet set;
  std::vector<Timestamp> timestamps;
};

std::uintmax_t bytes_of(const Sequence& sequence) {
  return static_cast<std::uintmax_t>(sequence.width) * static_cast<std::uintmax_t>(sequence.height) *
         (sequence.is_8_bit() ? 1 : 2);
}

void require_room(const std::filesystem::path& folder, const std::vector<Sequence>& sequences,
                  const RecorderLimits& limits) {
  std::uintmax_t trigger = 0;
  for (const Sequence& sequence : sequences) trigger += bytes_of(sequence);
  const std::uintmax_t needed = limits.least_space + static_cast<std::uintmax_t>(limits.triggers_of_a_sweep) * trigger;
  std::error_code failure;
  const auto space = std::filesystem::space(folder, failure);
  if (failure) throw cannot_write(folder, failure.message());
  if (space.available < needed)
    throw cannot_write(folder, fmt::format("the disk has room for {} MB and a sweep needs some {} MB: make room, or "
                                           "record to another one",
                                           space.available >> 20, (needed >> 20) + 1));
}

}  // namespace

struct CaptureRecorder::State {
  std::filesystem::path folder;
  RecorderLimits limits;
  std::vector<std::unique_ptr<RecordingWriter>> writers;
  std::vector<SequenceFiles> files;

  mutable std::mutex mutex;  ///< guards what follows
  std::condition_variable_any changed;
  std::deque<Waiting> queue;
  std::string trouble;
  bool is_ended = false;

  std::jthread thread;  ///< last: it ends before what it uses goes

  void store(const Waiting& waiting);
  void run();
};

CaptureRecorder::CaptureRecorder(const std::filesystem::path& folder, const std::vector<Sequence>& sequences,
                                 const RecorderLimits& limits)
    : state_(std::make_unique<State>()) {
  State& state = *state_;
  state.folder = folder;
  state.limits = limits;
  std::filesystem::create_directories(folder);
  require_room(folder, sequences, limits);
  for (const Sequence& sequence : sequences) {
    SequenceFiles files{.camera = sequence.camera, .frames = {}};
    files.bit_depth = sequence.bit_depth;
    files.black_level = sequence.black_level;
    files.saturation = sequence.saturation;
    files.recording = sequence.camera + "/frames.tiff";
    state.writers.push_back(std::make_unique<RecordingWriter>(folder / files.recording,
                                                              ImageSize{sequence.width, sequence.height},
                                                              sequence.is_8_bit() ? 8 : 16, most_frames));
    state.files.push_back(std::move(files));
  }
  state.thread = std::jthread([&state] { state.run(); });
}

CaptureRecorder::~CaptureRecorder() {
  if (!state_) return;
  const std::lock_guard lock(state_->mutex);
  state_->is_ended = true;
  state_->changed.notify_all();
}

void CaptureRecorder::State::store(const Waiting& waiting) {
  for (std::size_t c = 0; c < files.size(); ++c) {
    SequenceFiles& own = files[c];
    const int number = own.count++;
    const bool is_there = waiting.set.images[c].has_value() && waiting.timestamps[c].has_value();
    own.dropped.push_back(number);
    own.timestamps_ns.push_back(no_timestamp);
    if (!is_there) continue;
    writers[c]->append(*waiting.set.images[c]);
    own.dropped.pop_back();
    own.timestamps_ns.back() = *waiting.timestamps[c];
  }
}

void CaptureRecorder::State::run() {
  std::unique_lock lock(mutex);
  while (true) {
    changed.wait(lock, [&] { return !queue.empty() || is_ended; });
    if (queue.empty()) return;
    const Waiting waiting = std::move(queue.front());
    queue.pop_front();
    lock.unlock();
    std::string failure;
    try {
      if (limits.delay.count() > 0) std::this_thread::sleep_for(limits.delay);
      if (std::filesystem::space(folder).available < limits.least_space)
        throw cannot_write(folder, "the disk is full: make room, or record to another one");
      store(waiting);
    } catch (const std::exception& error) {
      failure = error.what();
      for (SequenceFiles& own : files)  // all to the same trigger
        while (own.count < files[0].count)
          own.dropped.push_back(own.count++), own.timestamps_ns.push_back(no_timestamp);
    }
    lock.lock();
    if (failure.empty()) continue;
    trouble = failure;
    return;
  }
}

bool CaptureRecorder::add(const FrameSet& set, const std::vector<Timestamp>& timestamps) {
  const std::lock_guard lock(state_->mutex);
  if (state_->trouble.empty() && state_->queue.size() >= state_->limits.most_waiting)
    state_->trouble = fmt::format(
        "{}: the disk is too slow for the frames: record to a faster one, or lower the frame "
        "rate or the region",
        state_->folder.string());
  if (!state_->trouble.empty()) return false;
  state_->queue.push_back({set, timestamps});
  state_->changed.notify_all();
  return true;
}

std::string CaptureRecorder::trouble() const {
  const std::lock_guard lock(state_->mutex);
  return state_->trouble;
}

std::vector<SequenceFiles> CaptureRecorder::finish() {
  State& state = *state_;
  {
    const std::lock_guard lock(state.mutex);
    state.is_ended = true;
    state.changed.notify_all();
  }
  state.thread.join();
  for (std::size_t c = 0; c < state.writers.size(); ++c) {
    if (state.files[c].count == static_cast<int>(state.files[c].dropped.size()))
      throw no_result(fmt::format("{}: no frame was recorded{}{}", state.files[c].camera,
                                  state.trouble.empty() ? "" : ": ", state.trouble));
    state.writers[c]->commit();
  }
  return state.files;
}

std::optional<FrameSet> RecordedSource::next() {
  if (ends_with_recorder_ && !is_recording_) return std::nullopt;
  auto set = live_.next();
  if (set && is_recording_) is_recording_ = recorder_.add(*set, live_.timestamps());
  return set;
}

Capture describe_capture(const std::filesystem::path& folder, std::vector<SequenceFiles> files,
                         const LiveSource& live) {
  Capture capture;
  capture.folder = folder;
  capture.sequences = std::move(files);
  capture.frame_interval_ns = live.interval_ns();
  capture.is_triggered = live.is_triggered();
  for (std::size_t c = 0; c < capture.sequences.size(); ++c)
    if (const auto exposure_us = live.settings(c).exposure_us; exposure_us && *exposure_us > 0)
      capture.sequences[c].exposure_ms = {*exposure_us / 1000};
  return capture;
}

}  // namespace pagesweep
