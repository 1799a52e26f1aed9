// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/live/live_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <ranges>
#include <set>
#include <thread>
#include <utility>

#include "pagesweep/base/error.h"
#include "pagesweep/live/pair_frames.h"

namespace pagesweep {
namespace {

using std::chrono::milliseconds;

constexpr int most_instants = 100'000;
constexpr auto longest_silence = milliseconds(800);
constexpr auto longest_start = milliseconds(1500);
constexpr auto patience = milliseconds(20);
constexpr auto between_statuses = milliseconds(200);
constexpr double usual_rate_hz = 30;        ///< of software triggers
constexpr std::size_t most_waiting = 1000;  ///< frames a camera
constexpr double clearly_slower = 0.8;
constexpr std::size_t numbers_kept = 256;

double seconds(Clock::duration duration) { return std::chrono::duration<double>(duration).count(); }

/// One camera and the thread that empties its buffers.
class Feed {
 public:
  Feed(std::unique_ptr<GenicamCamera> camera, std::mutex& mutex, std::condition_variable& arrived)
      : camera_(std::move(camera)), mutex_(mutex), arrived_(arrived) {}

  void start() {
    camera_->start();
    started_ = last_ = Clock::now();
    thread_ = std::jthread([this](const std::stop_token& stop) {
      while (!stop.stop_requested()) camera_->receive(milliseconds(50), [this](const RawFrame& frame) { take(frame); });
    });
  }
  void stop() {
    thread_.request_stop();
    if (thread_.joinable()) thread_.join();
    is_gone_ ? camera_->abandon() : camera_->stop();
  }
  /// It does not answer any more.
  void give_up() { is_gone_ = true; }
  GenicamCamera& camera() { return *camera_; }

  // What follows needs the mutex.
  std::deque<LiveFrame> frames;
  std::int64_t damaged = 0, whole = 0;
  std::int64_t lost() const { return std::max<std::int64_t>(0, counter_.total() - whole - damaged); }
  bool has_sent() const { return counter_.total() > 0; }
  Clock::duration silence(Clock::time_point now) const { return now - last_; }
  /// Frames a second, lately.
  double rate_hz() const {
    if (recent_.size() < 2) return 0;
    return static_cast<double>(recent_.size() - 1) / std::max(1e-6, seconds(recent_.back() - recent_.front()));
  }

 private:
  void take(const RawFrame& raw) {
    if (raw.id == 0) return;  // no frame has it: a buffer of which not even the beginning came, as the count will tell
    LiveFrame frame{0, raw.timestamp_ns, raw.arrival, {}};
    if (raw.is_whole) frame.image = to_gray_image(raw, camera_->bit_depth());
    const std::lock_guard lock(mutex_);
    frame.number = counter_.count(raw.id);
    // Packets that are late enough make a second buffer of the same frame.
    if (!seen_.insert(frame.number).second) return;
    if (seen_.size() > numbers_kept) seen_.erase(seen_.begin());
    last_ = raw.arrival;
    recent_.push_back(raw.arrival);
    while (recent_.back() - recent_.front() > std::chrono::seconds(1)) recent_.pop_front();
    if (raw.is_whole) {
      ++whole;
      frames.push_back(std::move(frame));
    } else {
      ++damaged;
    }
    arrived_.notify_all();
  }

  std::unique_ptr<GenicamCamera> camera_;
  std::mutex& mutex_;
  std::condition_variable& arrived_;
  FrameCounter counter_;
  std::set<std::int64_t> seen_;  ///< numbers of the latest frames
  bool is_gone_ = false;
  Clock::time_point started_, last_;
  std::deque<Clock::time_point> recent_;
  std::jthread thread_;
};

/// A trigger and its place in the sweep.
struct Instant {
  FrameSet set;
  std::vector<Timestamp> stamps;
  Clock::time_point arrival;  ///< of its last frame
};

bool is_whole(const Instant& instant) {
  return std::ranges::all_of(instant.stamps, [](const Timestamp& stamp) { return stamp.has_value(); });
}

}  // namespace

struct LiveSource::State {
  std::vector<Sequence> sequences;
  LiveOptions options;
  std::function<void(const LiveStatus&)> observe;
  std::mutex mutex;
  std::condition_variable arrived;
  std::vector<std::unique_ptr<Feed>> feeds;
  std::jthread trigger_thread;
  FramePairing pairing;
  SweepWatch watch;
  std::optional<TriggerTimes> times;
  std::deque<Instant> ready;  ///< before the sweep: the frames that go before it
  std::vector<Timestamp> stamps;
  Clock::time_point started, last_status, sweep_begun, last_arrival;
  bool is_done = false, is_stopping = false, is_triggered = true;
  int count = 0;
  std::string ended_early;
  std::vector<std::string> remarks;
  std::vector<bool> is_slow;
  std::jthread stopper;  ///< stops the cameras while their frames are still being used

  State(std::vector<Sequence> of_cameras, const LiveOptions& given, double interval_ns)
      : sequences(std::move(of_cameras)),
        options(given),
        pairing(sequences.size(), interval_ns),
        watch(sequences),
        is_slow(sequences.size(), false) {}

  void start();
  void send_triggers(const std::stop_token& stop, double rate_hz);
  void collect(std::unique_lock<std::mutex>& lock);
  void pair(Clock::time_point now, bool ended);
  void add(Trigger trigger);
  void begin_sweep();
  void place(Instant& instant);
  void look_for_faults(Clock::time_point now);
  void look_for_silent_at_end(Clock::time_point now);
  void lose(std::size_t camera);
  void fail(const std::string& what);
  void finish();
  void stop();
  LiveStatus status() const;
  void report(Clock::time_point now);
};

void LiveSource::State::start() {
  for (auto& feed : feeds) feed->start();
  started = last_status = Clock::now();
  const DeviceSettings& settings = feeds[0]->camera().settings();
  is_triggered = settings.trigger != TriggerMode::free_running || feeds.size() == 1;
  if (settings.trigger == TriggerMode::software)
    trigger_thread = std::jthread([this, rate = settings.frame_rate.value_or(usual_rate_hz)](
                                      const std::stop_token& stop) { send_triggers(stop, rate); });
}

void LiveSource::State::send_triggers(const std::stop_token& stop, double rate_hz) {
  const auto interval = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1 / rate_hz));
  for (auto next = Clock::now(); !stop.stop_requested(); next += interval) {
    std::this_thread::sleep_until(next);
    for (auto& feed : feeds) feed->camera().trigger();
  }
}

void LiveSource::State::collect(std::unique_lock<std::mutex>& lock) {
  const auto has_frames = [&] { return std::ranges::any_of(feeds, [](const auto& f) { return !f->frames.empty(); }); };
  arrived.wait_for(lock, patience, has_frames);
  for (std::size_t c = 0; c < feeds.size(); ++c) {
    if (feeds[c]->frames.size() > most_waiting)
      fail(fmt::format("{}: frames come faster than this computer can use them", sequences[c].camera));
    for (LiveFrame& frame : feeds[c]->frames) pairing.add(c, std::move(frame));
    feeds[c]->frames.clear();
  }
}

void LiveSource::State::pair(Clock::time_point now, bool ended) {
  while (!is_done) {
    auto trigger = pairing.next(now, ended);
    if (!trigger) return;
    add(*std::move(trigger));
  }
}

void LiveSource::State::add(Trigger trigger) {
  Instant instant;
  for (std::size_t c = 0; c < trigger.frames.size(); ++c) {
    auto& frame = trigger.frames[c];
    instant.stamps.push_back(frame ? Timestamp(frame->timestamp_ns) : std::nullopt);
    if (frame) instant.arrival = std::max(instant.arrival, frame->arrival);
    // Clocks of cameras that run freely are set to the first one's as well as arrivals tell.
    if (frame && !is_triggered) *instant.stamps.back() -= pairing.ahead_ns(c);
    instant.set.images.push_back(frame ? std::optional(std::move(frame->image)) : std::nullopt);
  }
  const bool was_waiting = watch.state() == SweepWatch::State::waiting;
  const auto state = watch.look(instant.set);
  if (!was_waiting) place(instant);
  if (was_waiting || instant.set.index >= 0) ready.push_back(std::move(instant));
  if (was_waiting && state == SweepWatch::State::sweeping) begin_sweep();
  if (was_waiting && state == SweepWatch::State::waiting && ready.size() > frames_around_sweep) ready.pop_front();
  if (state == SweepWatch::State::over) is_done = true;
}

void LiveSource::State::begin_sweep() {
  sweep_begun = Clock::now();
  while (ready.size() > 1 && !is_whole(ready.front())) ready.pop_front();
  times.emplace(pairing.interval_ns(), is_triggered, ready.front().stamps);
  for (Instant& instant : ready) place(instant);
  std::erase_if(ready, [](const Instant& instant) { return instant.set.index < 0; });
}

void LiveSource::State::place(Instant& instant) {
  auto place = times->place(instant.stamps);
  const bool is_good = place && place->index < most_instants;
  instant.set.index = is_good ? place->index : -1;
  if (!is_good) return;
  instant.set.late = std::move(place->late);
  count = place->index + 1;
}

void LiveSource::State::fail(const std::string& what) {
  if (is_done) return;
  if (watch.state() == SweepWatch::State::waiting) throw Error(ErrorKind::cannot_read, what);
  ended_early = what;
  is_done = true;
}

void LiveSource::State::lose(std::size_t camera) {
  feeds[camera]->give_up();
  fail(fmt::format("{}: it has stopped sending frames after {}: see to its power, cable and temperature",
                   sequences[camera].camera, feeds[camera]->whole));
}

/// A short sweep may be over before a silence is long enough to be one.
void LiveSource::State::look_for_silent_at_end(Clock::time_point now) {
  const auto silence = [&](const std::unique_ptr<Feed>& feed) { return seconds(feed->silence(now)); };
  const double least = std::ranges::min(feeds | std::views::transform(silence));
  for (std::size_t c = 0; c < feeds.size() && ended_early.empty(); ++c) {
    if (1e9 * (silence(feeds[c]) - least) < 0.5 * frames_around_sweep * pairing.interval_ns()) continue;
    is_done = false;
    lose(c);
  }
}

void LiveSource::State::look_for_faults(Clock::time_point now) {
  double fastest = 0;
  bool any_sent = false, all_silent = true;
  for (const auto& feed : feeds) {
    fastest = std::max(fastest, feed->rate_hz());
    any_sent |= feed->has_sent();
    all_silent &= feed->silence(now) > longest_silence;
  }
  const bool is_wired = feeds[0]->camera().settings().trigger == TriggerMode::hardware;
  for (std::size_t c = 0; c < feeds.size(); ++c) {
    const std::string& name = sequences[c].camera;
    if (!feeds[c]->has_sent()) {
      if (now - started < longest_start || (is_wired && !any_sent)) continue;
      fail(
          fmt::format("{}: no frame has come: see that its trigger is connected, and that neither a firewall nor a "
                      "switch keeps its packets back",
                      name));
    } else if (feeds[c]->silence(now) > longest_silence) {
      if (all_silent && is_wired && watch.state() == SweepWatch::State::waiting) continue;  // nobody triggers yet
      if (all_silent && is_wired)
        return fail("the triggers have ended before the stripe had left: let them run on until it has");
      return lose(c);
    } else if (!is_slow[c] && now - started > longest_start && feeds[c]->rate_hz() < clearly_slower * fastest) {
      is_slow[c] = true;
      remarks.push_back(
          fmt::format("{}: it has slowed down to {:.0f} frames a second while others send {:.0f}: it may "
                      "be too hot, or its network too slow",
                      name, feeds[c]->rate_hz(), fastest));
    }
  }
  const bool is_waiting = watch.state() == SweepWatch::State::waiting;
  if (is_waiting && seconds(now - started) > options.wait_s)
    throw no_result(
        fmt::format("no stripe of light came within {} s: start the sweep within that time, or raise "
                    "--wait",
                    options.wait_s));
  if (!is_waiting && seconds(now - sweep_begun) > options.longest_s)
    fail(fmt::format("the stripe had not left after {} s: raise --longest if that is as it should be",
                     options.longest_s));
}

void LiveSource::State::finish() {
  for (Sequence& sequence : sequences) sequence.count = count;
  if (!is_stopping) stopper = std::jthread([this] { stop(); });
  is_stopping = true;
}

void LiveSource::State::stop() {
  trigger_thread.request_stop();
  if (trigger_thread.joinable()) trigger_thread.join();
  for (auto& feed : feeds) feed->stop();
}

LiveStatus LiveSource::State::status() const {
  LiveStatus status;
  status.state = watch.state();
  status.frames = count;
  status.remarks = remarks;
  for (std::size_t c = 0; c < feeds.size(); ++c) {
    LiveStatus::Camera camera{sequences[c].camera, feeds[c]->rate_hz(), pairing.counts()[c], watch.position(c)};
    camera.counts.received = feeds[c]->whole;
    camera.counts.damaged = feeds[c]->damaged;
    camera.counts.lost = feeds[c]->lost();
    status.cameras.push_back(std::move(camera));
  }
  return status;
}

void LiveSource::State::report(Clock::time_point now) {
  if (!observe || now - last_status < between_statuses) return;
  last_status = now;
  std::unique_lock lock(mutex);
  const LiveStatus now_status = status();
  lock.unlock();
  remarks.clear();
  observe(now_status);
}

LiveSource::LiveSource(std::vector<std::unique_ptr<GenicamCamera>> cameras, std::vector<Sequence> sequences,
                       const LiveOptions& options, std::function<void(const LiveStatus&)> observe) {
  for (Sequence& sequence : sequences) sequence.count = most_instants;
  state_ = std::make_unique<State>(std::move(sequences), options, 0);
  state_->observe = std::move(observe);
  for (auto& camera : cameras) {
    for (const std::string& remark : camera->remarks()) state_->remarks.push_back(remark);
    state_->feeds.push_back(std::make_unique<Feed>(std::move(camera), state_->mutex, state_->arrived));
  }
  state_->start();
}

LiveSource::~LiveSource() {
  state_->finish();
  if (state_->stopper.joinable()) state_->stopper.join();
}

const std::vector<Sequence>& LiveSource::sequences() const { return state_->sequences; }
const std::vector<Timestamp>& LiveSource::timestamps() const { return state_->stamps; }
Clock::time_point LiveSource::last_arrival() const { return state_->last_arrival; }
const DeviceSettings& LiveSource::settings(std::size_t camera) const {
  return state_->feeds[camera]->camera().settings();
}
double LiveSource::interval_ns() const { return state_->pairing.interval_ns(); }
bool LiveSource::is_triggered() const { return state_->is_triggered; }
const std::string& LiveSource::ended_early() const { return state_->ended_early; }
LiveStatus LiveSource::status() const {
  if (state_->stopper.joinable()) state_->stopper.join();
  const std::lock_guard lock(state_->mutex);
  return state_->status();
}

std::optional<FrameSet> LiveSource::next() {
  State& state = *state_;
  while (true) {
    const bool is_sweeping = state.watch.state() != SweepWatch::State::waiting;
    if (is_sweeping && !state.ready.empty()) {
      Instant instant = std::move(state.ready.front());
      state.ready.pop_front();
      state.stamps = std::move(instant.stamps);
      state.last_arrival = instant.arrival;
      state.report(Clock::now());
      return std::move(instant.set);
    }
    if (state.is_done) {
      state.finish();
      return std::nullopt;
    }
    std::unique_lock lock(state.mutex);
    state.collect(lock);
    const auto now = Clock::now();
    state.look_for_faults(now);
    lock.unlock();
    state.pair(now, state.is_done && !state.ended_early.empty());
    if (state.is_done && state.ended_early.empty()) {
      lock.lock();
      state.look_for_silent_at_end(now);
      lock.unlock();
    }
    state.report(now);
  }
}

}  // namespace pagesweep
