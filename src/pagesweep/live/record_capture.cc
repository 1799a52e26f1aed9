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
constexpr std::size_t most_waiting = 200;                         ///< triggers; two seconds at 100 a second
constexpr std::uintmax_t least_space = std::uintmax_t{64} << 20;  ///< [bytes] to be left on the disk

struct Waiting {
  FrameSet set;
  std::vector<Timestamp> timestamps;
};

}  // namespace

struct CaptureRecorder::State {
  std::filesystem::path folder;
  std::vector<Sequence> sequences;
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

CaptureRecorder::CaptureRecorder(const std::filesystem::path& folder, const std::vector<Sequence>& sequences)
    : state_(std::make_unique<State>()) {
  State& state = *state_;
  state.folder = folder;
  state.sequences = sequences;
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
    if (queue.empty() || !trouble.empty()) return;
    const Waiting waiting = std::move(queue.front());
    queue.pop_front();
    lock.unlock();
    std::string failure;
    try {
      if (std::filesystem::space(folder).available < least_space) throw cannot_write(folder, "the disk is full");
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
  if (state_->trouble.empty() && state_->queue.size() >= most_waiting)
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
  return capture;
}

}  // namespace pagesweep
