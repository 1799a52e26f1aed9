// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/live/fake_rig.h"

#include <arv.h>
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>
#include <mutex>
#include <thread>

#include "pagesweep/base/error.h"
#include "pagesweep/live/arv_helpers_internal.h"

namespace pagesweep {
namespace {

using Clock = std::chrono::steady_clock;

// Registers of Aravis' fake camera (its own GenICam file) and of GigE Vision's bootstrap.
constexpr guint32 width_register = 0x100, height_register = 0x104, acquisition_register = 0x124;
constexpr guint32 period_register = 0x138;
constexpr guint32 sensor_height_register = 0x118, sensor_width_register = 0x11c;
constexpr guint32 trigger_mode_register = 0x300, trigger_source_register = 0x304, software_trigger_register = 0x30c;
constexpr guint32 vendor_register = 0x48, model_register = 0x68, privilege_register = 0xa00;
constexpr guint32 line_source = 0, software_source = 1;

constexpr double polls_a_second = 500;  ///< how often a fake camera looks whether a client has triggered it
constexpr std::int64_t clock_apart_ns = 3'141'592'653;  ///< of the cameras' clocks

void write_text(ArvFakeCamera* camera, guint32 address, const std::string& text) {
  arv_fake_camera_write_memory(camera, address, static_cast<guint32>(text.size() + 1), text.c_str());
}

guint32 read(ArvFakeCamera* camera, guint32 address) {
  guint32 value = 0;
  arv_fake_camera_read_register(camera, address, &value);
  return value;
}

/// What a camera sees without the stripe: the darkest that each pixel ever was.
Image<std::uint8_t> darkest(const Frames& frames) {
  Image<std::uint8_t> dark(frames.width(), frames.height(), 255);
  for (int i = 0; i < frames.count(); ++i) {
    if (!frames.has(i)) continue;
    const auto& image = std::get<Image<std::uint8_t>>(frames.frame(i));
    std::ranges::transform(dark.pixels(), image.pixels(), dark.pixels().begin(),
                           [](auto a, auto b) { return std::min(a, b); });
  }
  return dark;
}

/// One camera on the network. A thread of Aravis asks it for frames.
class FakeCamera {
 public:
  FakeCamera(std::string name, std::string address, int number, const FakeRigOptions& options)
      : name_(std::move(name)), address_(std::move(address)), number_(number), options_(options) {}
  virtual ~FakeCamera() = default;

  void connect() {
    const std::string serial = fmt::format("fake-{}", name_);
    camera_.reset(
        ARV_GV_FAKE_CAMERA(g_object_new(ARV_TYPE_GV_FAKE_CAMERA, "interface-name", address_.c_str(), "serial-number",
                                        serial.c_str(), "gvsp-lost-ratio", options_.packet_loss, nullptr)));
    if (!camera_ || !arv_gv_fake_camera_is_running(camera_.get())) {
      camera_.reset();
      throw cannot_read(address_,
                        "no camera can be served there: it must be an address of this computer (`ip address "
                        "add " +
                            address_ + "/8 dev lo`), on which no other fake rig runs");
    }
    ArvFakeCamera* own = device();
    write_text(own, vendor_register, "pagesweep");
    write_text(own, model_register, "fake rig");
    arv_fake_camera_write_register(own, sensor_width_register, static_cast<guint32>(width()));
    arv_fake_camera_write_register(own, sensor_height_register, static_cast<guint32>(height()));
    arv_fake_camera_write_register(own, width_register, static_cast<guint32>(width()));
    arv_fake_camera_write_register(own, height_register, static_cast<guint32>(height()));
    arv_fake_camera_set_trigger_frequency(own, polls_a_second);
    arv_fake_camera_set_fill_pattern(own, &FakeCamera::fill, this);
  }
  void disconnect() { camera_.reset(); }
  bool is_connected() const { return camera_ != nullptr; }
  bool is_streaming() const {
    return camera_ && read(device(), acquisition_register) != 0 && read(device(), privilege_register) != 0;
  }
  /// Whether the client wants triggers from the line. Aravis' camera knows only software triggers: the line sends them.
  bool is_wired() {
    if (!is_streaming()) {
      if (is_wired_) arv_fake_camera_set_trigger_frequency(device(), polls_a_second);
      return is_wired_ = false;
    }
    if (read(device(), trigger_mode_register) == 1 && read(device(), trigger_source_register) == line_source) {
      is_wired_ = true;
      arv_fake_camera_write_register(device(), trigger_source_register, software_source);
      arv_fake_camera_set_trigger_frequency(device(), options_.frame_rate);
    }
    return is_wired_;
  }
  /// \param frame         of the capture; negative or beyond its end: dark
  /// \param timestamp_ns  by the rig's clock
  void trigger(long frame, std::int64_t timestamp_ns) {
    {
      const std::lock_guard lock(mutex_);
      next_ = {frame, timestamp_ns};
      is_busy_ = true;
    }
    arv_fake_camera_write_register(device(), software_trigger_register, 1);
  }
  /// Whether it has not yet acted on the last trigger.
  bool is_busy() const { return is_busy_; }
  /// The sweep begins, for a camera that is not triggered by the line.
  void begin_sweep(std::int64_t begin_ns) { sweep_begin_ns_ = begin_ns; }

  const std::string& name() const { return name_; }
  FakeCameraCounts counts() const { return {name_, address_, "fake-" + name_, sent_.load()}; }
  bool has_died() const { return has_died_; }
  void revive() { has_died_ = false, may_die_ = false, connect(); }

 protected:
  virtual int width() const = 0;
  virtual int height() const = 0;
  virtual void fill(ArvBuffer* buffer, long frame) = 0;
  ArvFakeCamera* device() const { return arv_gv_fake_camera_get_fake_camera(camera_.get()); }

 private:
  static void fill(ArvBuffer* buffer, void* self, guint32, guint32, ArvPixelFormat) {
    static_cast<FakeCamera*>(self)->fill(buffer);
  }
  void fill(ArvBuffer* buffer) {
    auto [frame, timestamp_ns] = take_next();
    if (!is_wired_) {
      const bool is_triggered = read(device(), trigger_mode_register) == 1;
      const std::int64_t period_ns = is_triggered ? std::llround(1e9 / options_.frame_rate)
                                                  : std::max<std::int64_t>(1, read(device(), period_register)) * 1000;
      timestamp_ns = g_get_real_time() * 1000;
      if (!is_triggered) timestamp_ns = (timestamp_ns + period_ns / 2) / period_ns * period_ns;
      const std::int64_t begin_ns = sweep_begin_ns_;
      frame = begin_ns > 0 ? std::lround(static_cast<double>(timestamp_ns - begin_ns) / static_cast<double>(period_ns))
                           : -1;
    }
    if (name_ == options_.stall_camera && frame >= options_.stall_frame && !has_stalled_.exchange(true))
      std::this_thread::sleep_for(std::chrono::duration<double>(options_.stall_s));
    if (name_ == options_.dead_camera && frame >= options_.dead_frame && may_die_) has_died_ = true;
    arv_buffer_set_timestamp(buffer, static_cast<guint64>(timestamp_ns + number_ * clock_apart_ns));
    fill(buffer, frame);
    ++sent_;
  }

  struct Next {
    long frame = -1;
    std::int64_t timestamp_ns = 0;
  };
  Next take_next() {
    const std::lock_guard lock(mutex_);
    is_busy_ = false;
    return next_;
  }

  std::string name_, address_;
  int number_;
  const FakeRigOptions& options_;
  ArvHandle<ArvGvFakeCamera> camera_;
  std::atomic<bool> is_wired_ = false, has_stalled_ = false, has_died_ = false, may_die_ = true;
  std::atomic<bool> is_busy_ = false;  ///< with a trigger that it has not yet acted on
  std::atomic<long> sent_ = 0;
  std::atomic<std::int64_t> sweep_begin_ns_ = 0;
  std::mutex mutex_;  ///< guards what follows
  Next next_;
};

class MatrixCamera : public FakeCamera {
 public:
  MatrixCamera(Frames frames, std::string address, int number, const FakeRigOptions& options)
      : FakeCamera(frames.sequence().camera, std::move(address), number, options),
        frames_(std::move(frames)),
        dark_(darkest(frames_)),
        end_(static_cast<long>(frames_.count()) * options.repeat) {}

  const Sequence& sequence() const { return frames_.sequence(); }
  long end() const { return end_; }
  /// Whether the capture lacks the frame that would come.
  bool is_dropped(long frame) const { return frame >= 0 && frame < end_ && !frames_.has(of_capture(frame)); }

 protected:
  int width() const override { return frames_.width(); }
  int height() const override { return frames_.height(); }
  void fill(ArvBuffer* buffer, long frame) override {
    const bool is_dark = frame < 0 || frame >= end_ || !frames_.has(of_capture(frame));
    const auto& image = is_dark ? dark_ : std::get<Image<std::uint8_t>>(frames_.frame(of_capture(frame)));
    std::size_t size = 0;
    void* data = const_cast<void*>(arv_buffer_get_data(buffer, &size));
    const std::size_t room = static_cast<std::size_t>(arv_buffer_get_image_width(buffer)) *
                             static_cast<std::size_t>(arv_buffer_get_image_height(buffer));
    std::memcpy(data, image.data(), std::min(room, image.size()));
  }

 private:
  int of_capture(long frame) const { return static_cast<int>(frame % frames_.count()); }

  Frames frames_;
  Image<std::uint8_t> dark_;
  long end_;
};

class LineCamera : public FakeCamera {
 public:
  LineCamera(Picture picture, std::string address, int number, const FakeRigOptions& options)
      : FakeCamera("line", std::move(address), number, options),
        rows_(options.line_rows),
        picture_(std::move(picture)) {}

  long blocks() const { return (picture_.height() + rows_ - 1) / rows_; }
  int channels() const { return picture_.channels; }

 protected:
  int width() const override { return picture_.width(); }
  int height() const override { return rows_; }
  void fill(ArvBuffer* buffer, long block) override {
    std::size_t size = 0;
    auto* out = static_cast<std::uint8_t*>(const_cast<void*>(arv_buffer_get_data(buffer, &size)));
    const auto row_bytes = static_cast<std::size_t>(picture_.width() * picture_.channels);
    for (int r = 0; r < rows_; ++r, out += row_bytes) {
      const long y = block * rows_ + r;
      std::fill_n(out, row_bytes, std::uint8_t{0});
      if (block < 0 || y >= picture_.height()) continue;
      std::visit(
          [&](const auto& samples) {
            const auto row = samples.row(static_cast<int>(y));
            const int shift = sizeof(row[0]) == 2 ? 8 : 0;
            std::ranges::transform(row, out, [shift](auto gray) { return static_cast<std::uint8_t>(gray >> shift); });
          },
          picture_.samples);
    }
  }

 private:
  int rows_;
  Picture picture_;
};

}  // namespace

struct FakeRig::State {
  FakeRigOptions options;
  std::vector<std::unique_ptr<MatrixCamera>> cameras;
  std::unique_ptr<LineCamera> line;
  mutable std::mutex mutex;  ///< guards what is connected
  std::atomic<int> sweeps = 0;
  std::int64_t sweep_tick = -1;
  long blocks_sent = 0;
  std::optional<Clock::time_point> died;
  std::jthread generator;

  void run(const std::stop_token& stop);
  void tick(std::int64_t number, std::int64_t timestamp_ns);
  void send_lines(long frame, std::int64_t timestamp_ns);
  void bury_and_revive();
};

void FakeRig::State::bury_and_revive() {
  for (auto& camera : cameras) {
    if (camera->is_connected() && camera->has_died()) {
      camera->disconnect();
      died = Clock::now();
    }
    if (!camera->is_connected() && options.back_s > 0 &&
        Clock::now() - *died > std::chrono::duration<double>(options.back_s))
      camera->revive();
  }
}

void FakeRig::State::send_lines(long frame, std::int64_t timestamp_ns) {
  if (!line || !line->is_wired() || frame < 0) return;
  // Blocks come evenly while the head moves.
  const long due = std::min(line->blocks(), (frame + 1) * line->blocks() / std::max(1L, cameras[0]->end()));
  if (blocks_sent < due && !line->is_busy()) line->trigger(blocks_sent++, timestamp_ns);
}

void FakeRig::State::tick(std::int64_t number, std::int64_t timestamp_ns) {
  const std::lock_guard lock(mutex);
  bury_and_revive();
  const bool all_stream = std::ranges::all_of(
      cameras, [](const auto& camera) { return !camera->is_connected() || camera->is_streaming(); });
  if (!all_stream) sweep_tick = -1;
  if (all_stream && sweep_tick < 0) {
    const double delay = std::ceil(options.delay_s * options.frame_rate);
    sweep_tick = number + static_cast<std::int64_t>(delay);
    blocks_sent = 0;
    ++sweeps;
    for (auto& camera : cameras)
      camera->begin_sweep(g_get_real_time() * 1000 + static_cast<std::int64_t>(options.delay_s * 1e9));
  }
  const long frame = sweep_tick < 0 ? -1 : static_cast<long>(number - sweep_tick);
  const auto skips = [&](const MatrixCamera& camera) {
    return camera.is_dropped(frame) ||
           (camera.name() == options.slow_camera && frame >= options.slow_frame && frame % 2 != 0);
  };
  for (auto& camera : cameras)
    if (camera->is_connected() && camera->is_wired() && !skips(*camera)) camera->trigger(frame, timestamp_ns);
  send_lines(frame, timestamp_ns);
}

void FakeRig::State::run(const std::stop_token& stop) {
  // Aravis' cameras look for triggers whenever the time of day is a multiple of their interval. The line is raised half
  // an interval before.
  const auto interval_us = static_cast<std::int64_t>(std::llround(1e6 / options.frame_rate));
  for (std::int64_t number = g_get_real_time() / interval_us; !stop.stop_requested();) {
    const std::int64_t ahead_us = number * interval_us - interval_us / 2 - g_get_real_time();
    if (ahead_us > 0) std::this_thread::sleep_for(std::chrono::microseconds(ahead_us));
    tick(number, number * interval_us * 1000);
    number = std::max<std::int64_t>(number + 1, g_get_real_time() / interval_us);  // what was slept through is lost
  }
}

FakeRig::FakeRig(std::vector<Frames> frames, std::optional<Picture> scan, const FakeRigOptions& options)
    : state_(std::make_unique<State>()) {
  State& state = *state_;
  state.options = options;
  int number = 0;
  const auto address = [&] { return fmt::format("127.0.0.{}", number + 1); };
  for (Frames& sequence : frames) {
    if (!sequence.sequence().is_8_bit())
      throw Error(ErrorKind::bad_input, fmt::format("{}: a fake rig serves frames of 8 bit, these have {}",
                                                    sequence.sequence().camera, sequence.sequence().bit_depth));
    state.cameras.push_back(std::make_unique<MatrixCamera>(std::move(sequence), address(), number, state.options));
    ++number;
  }
  if (scan) state.line = std::make_unique<LineCamera>(*std::move(scan), address(), number, state.options);
  for (auto& camera : state.cameras) camera->connect();
  if (state.line) state.line->connect();
  state.generator = std::jthread([&state](const std::stop_token& stop) { state.run(stop); });
}

FakeRig::~FakeRig() = default;

std::vector<FakeCameraCounts> FakeRig::counts() const {
  std::vector<FakeCameraCounts> counts;
  for (const auto& camera : state_->cameras) counts.push_back(camera->counts());
  if (state_->line) counts.push_back(state_->line->counts());
  return counts;
}

int FakeRig::sweeps() const { return state_->sweeps; }

Devices FakeRig::devices() const {
  Devices devices;
  for (const auto& camera : state_->cameras) {
    DeviceSettings& settings = devices.cameras[camera->name()];
    settings.dark_level = camera->sequence().black_level;
  }
  if (state_->line) {
    DeviceSettings& settings = devices.cameras["line"];
    settings.pixel_format = state_->line->channels() == 3 ? "RGB8" : "Mono8";
    settings.rows_a_buffer = state_->options.line_rows;
  }
  return devices;
}

}  // namespace pagesweep
