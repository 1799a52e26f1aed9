// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/live/genicam_camera.h"

#include <arv.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>
#include <stdexcept>

#include "pagesweep/base/error.h"
#include "pagesweep/live/arv_helpers_internal.h"
#include "pagesweep/live/gige_probe_internal.h"
#include "pagesweep/live/interface_mtu_internal.h"

namespace pagesweep {
namespace {

constexpr int buffers = 64;                ///< over half a second at 100 frames a second
constexpr int usual_packet = 1500;         ///< [bytes] what every network carries
constexpr int jumbo_packet = 9000;         ///< [bytes] what networks for cameras carry
constexpr double largest_rounding = 0.02;  ///< of an exposure, not worth a word
constexpr unsigned frame_retention_us = 100'000;
constexpr unsigned packet_timeout_us = 20'000;

struct PixelFormat {
  std::string_view name;
  int channels, bit_depth;
};
constexpr std::array formats{PixelFormat{"Mono8", 1, 8},   PixelFormat{"Mono10", 1, 10}, PixelFormat{"Mono12", 1, 12},
                             PixelFormat{"Mono14", 1, 14}, PixelFormat{"Mono16", 1, 16}, PixelFormat{"RGB8", 3, 8}};

PixelFormat format_named(const std::string& camera, const std::string& name) {
  for (const PixelFormat& format : formats)
    if (format.name == name) return format;
  throw Error(ErrorKind::bad_input, fmt::format("{}: pixel_format \"{}\" is not known here: use Mono8, Mono10, Mono12, "
                                                "Mono14 or Mono16, unpacked, or RGB8 for the scanner",
                                                camera, name));
}

}  // namespace

struct GenicamCamera::State {
  std::string name;
  DeviceSettings settings;
  PixelFormat format{};
  std::vector<std::string> remarks;
  ArvHandle<ArvCamera> camera;
  ArvHandle<ArvStream> stream;
  std::size_t payload = 0;
  bool is_running = false;

  Error trouble(const std::string& what, const std::string& advice) const {
    return {ErrorKind::bad_input, fmt::format("{}: {}: {}", name, what, advice)};
  }
  /// Runs a call of Aravis and turns its error into ours.
  template <class Call>
  auto ask(const std::string& what, const Call& call) {
    GError* failure = nullptr;
    const auto clear = [&] {
      const std::string message = failure->message;
      g_error_free(failure);
      return trouble(what, message);
    };
    if constexpr (std::is_void_v<decltype(call(&failure))>) {
      call(&failure);
      if (failure) throw clear();
    } else {
      const auto result = call(&failure);
      if (failure) throw clear();
      return result;
    }
  }

  void open(const std::string& id);
  Error silent(const std::string& id) const;
  Error taken() const;
  void set_region();
  void set_values();
  void read_exposure();
  void set_trigger();
  void set_packet_size();
  void make_stream();
};

void GenicamCamera::State::open(const std::string& id) {
  const auto answer = probe_gige(id);
  if (answer == GigeAnswer::none) throw silent(id);
  if (answer == GigeAnswer::taken) throw taken();
  GError* failure = nullptr;
  camera.reset(arv_camera_new(id.c_str(), &failure));
  g_clear_error(&failure);
  if (!camera) throw silent(id);
  ArvDevice* device = arv_camera_get_device(camera.get());
  if (ARV_IS_GV_DEVICE(device) && !arv_gv_device_is_controller(ARV_GV_DEVICE(device))) throw taken();
}

Error GenicamCamera::State::silent(const std::string& id) const {
  return {ErrorKind::cannot_read, fmt::format("{}: the camera \"{}\" does not answer: {}", name, id, why_silent(id))};
}

Error GenicamCamera::State::taken() const {
  return {ErrorKind::cannot_read,
          fmt::format("{}: another program has the camera: end that program; after a crash the camera is free again "
                      "within 3 s",
                      name)};
}

void GenicamCamera::State::set_region() {
  int sensor_width = 0, sensor_height = 0;
  ask("the sensor's size cannot be read",
      [&](GError** e) { arv_camera_get_sensor_size(camera.get(), &sensor_width, &sensor_height, e); });
  if (settings.left + settings.width > sensor_width || settings.top + settings.height > sensor_height)
    throw trouble(
        fmt::format("a region of {} x {} pixels at ({}, {}) does not fit into the sensor's {} x {}", settings.width,
                    settings.height, settings.left, settings.top, sensor_width, sensor_height),
        "give a region that does, or the rig of this camera");
  ask("the region is refused", [&](GError** e) {
    arv_camera_set_region(camera.get(), settings.left, settings.top, settings.width, settings.height, e);
  });
  int x = 0, y = 0, width = 0, height = 0;
  ask("the region cannot be read",
      [&](GError** e) { arv_camera_get_region(camera.get(), &x, &y, &width, &height, e); });
  if (width != settings.width || height != settings.height || x != settings.left || y != settings.top)
    throw trouble(fmt::format("the camera made a region of {} x {} pixels at ({}, {}) of the {} x {} at ({}, {}) that "
                              "were asked for",
                              width, height, x, y, settings.width, settings.height, settings.left, settings.top),
                  "give one that it can do, and calibrate the rig with it");
}

void GenicamCamera::State::set_values() {
  ask(fmt::format("pixel_format \"{}\" is refused", settings.pixel_format),
      [&](GError** e) { arv_camera_set_pixel_format_from_string(camera.get(), settings.pixel_format.c_str(), e); });
  const auto set = [&](const std::optional<double>& value, const std::string& what, auto is_available, auto setter) {
    if (!value) return;
    if (!ask(what + " cannot be asked for", [&](GError** e) { return is_available(camera.get(), e); }))
      throw trouble("it has no feature to set the " + what, "leave it out of devices.json, or change the firmware");
    ask(fmt::format("{} {} is refused", what, *value), [&](GError** e) { setter(camera.get(), *value, e); });
  };
  set(settings.exposure_us, "exposure", arv_camera_is_exposure_time_available, arv_camera_set_exposure_time);
  set(settings.gain, "gain", arv_camera_is_gain_available, arv_camera_set_gain);
  set(settings.black_level, "black level", arv_camera_is_black_level_available, arv_camera_set_black_level);
  if (settings.trigger == TriggerMode::free_running)
    set(settings.frame_rate, "frame rate", arv_camera_is_frame_rate_available, arv_camera_set_frame_rate);
}

/// As the camera has it, whether it was set or not.
void GenicamCamera::State::read_exposure() {
  GError* ignored = nullptr;  // a camera that does not tell it can be used all the same
  const double exposure_us = arv_camera_is_exposure_time_available(camera.get(), nullptr)
                                 ? arv_camera_get_exposure_time(camera.get(), &ignored)
                                 : 0;
  const bool is_known = !ignored && exposure_us > 0;
  g_clear_error(&ignored);
  if (!is_known) return;
  if (settings.exposure_us && std::abs(exposure_us - *settings.exposure_us) > largest_rounding * exposure_us)
    remarks.push_back(fmt::format("{}: its exposure is {:.6g} us instead of the {:.6g} us that were asked for", name,
                                  exposure_us, *settings.exposure_us));
  settings.exposure_us = exposure_us;
}

void GenicamCamera::State::set_trigger() {
  if (settings.trigger == TriggerMode::free_running) {
    GError* ignored = nullptr;  // a camera without triggers runs freely anyhow
    arv_camera_clear_triggers(camera.get(), &ignored);
    g_clear_error(&ignored);
    return;
  }
  const bool is_software = settings.trigger == TriggerMode::software;
  const std::string source = is_software ? "Software" : settings.trigger_line;
  ask(fmt::format("it cannot be triggered by \"{}\"", source),
      [&](GError** e) { arv_camera_set_trigger(camera.get(), source.c_str(), e); });
}

void GenicamCamera::State::set_packet_size() {
  if (!arv_camera_is_gv_device(camera.get())) return;
  const int before = static_cast<int>(ask("the packet size cannot be read",
                                          [&](GError** e) { return arv_camera_gv_get_packet_size(camera.get(), e); }));
  const int mtu = interface_mtu(ARV_GV_DEVICE(arv_camera_get_device(camera.get()))).value_or(usual_packet);
  const int size = settings.packet_size > 0 ? settings.packet_size : std::min(mtu, jumbo_packet);
  if (size > mtu)
    throw trouble(fmt::format("packets of {} bytes do not fit through the network, which carries {}", size, mtu),
                  fmt::format("set its MTU to {}, or packet_size to {} at most", jumbo_packet, mtu));
  arv_camera_gv_set_packet_size_adjustment(camera.get(), ARV_GV_PACKET_SIZE_ADJUSTMENT_NEVER);
  ask(fmt::format("packets of {} bytes are refused", size),
      [&](GError** e) { arv_camera_gv_set_packet_size(camera.get(), size, e); });
  if (before < size)
    remarks.push_back(
        fmt::format("{}: network packets of {} bytes are too small for the frames: set to {}", name, before, size));
  if (size < jumbo_packet)
    remarks.push_back(
        fmt::format("{}: the network carries packets of {} bytes only: at high frame rates set its MTU to {}", name,
                    size, jumbo_packet));
  settings.packet_size = size;
}

void GenicamCamera::State::make_stream() {
  stream.reset(ask("it sends no stream",
                   [&](GError** e) { return arv_camera_create_stream(camera.get(), nullptr, nullptr, e); }));
  if (ARV_IS_GV_STREAM(stream.get()))
    g_object_set(stream.get(), "frame-retention", frame_retention_us, "packet-timeout", packet_timeout_us,
                 "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED, "socket-buffer-size", 32 << 20, nullptr);
  payload =
      ask("the size of its frames cannot be read", [&](GError** e) { return arv_camera_get_payload(camera.get(), e); });
  for (int i = 0; i < buffers; ++i) arv_stream_push_buffer(stream.get(), arv_buffer_new_allocate(payload));
}

GenicamCamera::GenicamCamera(std::string name, const std::string& id, const DeviceSettings& settings)
    : state_(std::make_unique<State>()) {
  state_->name = std::move(name);
  state_->settings = settings;
  state_->format = format_named(state_->name, settings.pixel_format);
  state_->open(id);
  state_->set_region();
  state_->set_values();
  state_->read_exposure();
  state_->set_trigger();
  state_->set_packet_size();
  state_->ask("it cannot stream continuously", [&](GError** e) {
    arv_camera_set_acquisition_mode(state_->camera.get(), ARV_ACQUISITION_MODE_CONTINUOUS, e);
  });
  state_->make_stream();
}

GenicamCamera::~GenicamCamera() { stop(); }

const std::string& GenicamCamera::name() const { return state_->name; }
const std::vector<std::string>& GenicamCamera::remarks() const { return state_->remarks; }
int GenicamCamera::channels() const { return state_->format.channels; }
int GenicamCamera::bit_depth() const { return state_->format.bit_depth; }
int GenicamCamera::width() const { return state_->settings.width; }
int GenicamCamera::height() const { return state_->settings.height; }
const DeviceSettings& GenicamCamera::settings() const { return state_->settings; }

void GenicamCamera::start() {
  state_->ask("it does not start", [&](GError** e) { arv_camera_start_acquisition(state_->camera.get(), e); });
  state_->is_running = true;
}

void GenicamCamera::stop() {
  if (!state_->is_running) return;
  state_->is_running = false;
  GError* ignored = nullptr;  // a camera that is gone cannot be stopped
  arv_camera_stop_acquisition(state_->camera.get(), &ignored);
  g_clear_error(&ignored);
}

void GenicamCamera::abandon() {
  state_->is_running = false;
  static_cast<void>(state_->stream.release());
  static_cast<void>(state_->camera.release());
}

void GenicamCamera::trigger() {
  GError* ignored = nullptr;  // a trigger that was lost is a frame that does not come
  arv_camera_software_trigger(state_->camera.get(), &ignored);
  g_clear_error(&ignored);
}

bool GenicamCamera::receive(std::chrono::milliseconds longest, const std::function<void(const RawFrame&)>& use) {
  const auto timeout_us = static_cast<guint64>(std::chrono::microseconds(longest).count());
  ArvBuffer* buffer = arv_stream_timeout_pop_buffer(state_->stream.get(), timeout_us);
  if (!buffer) return false;
  RawFrame frame;
  frame.arrival = Clock::now();
  frame.id = arv_buffer_get_frame_id(buffer);
  frame.timestamp_ns = static_cast<std::int64_t>(arv_buffer_get_timestamp(buffer));
  frame.is_whole = arv_buffer_get_status(buffer) == ARV_BUFFER_STATUS_SUCCESS;
  if (frame.is_whole) {
    std::size_t size = 0;
    const void* data = arv_buffer_get_image_data(buffer, &size);
    frame.width = arv_buffer_get_image_width(buffer);
    frame.height = arv_buffer_get_image_height(buffer);
    frame.bytes = {static_cast<const std::byte*>(data), size};
    const auto sample_bytes = static_cast<std::size_t>(state_->format.bit_depth > 8 ? 2 : 1);
    const std::size_t expected = static_cast<std::size_t>(width()) * static_cast<std::size_t>(height()) *
                                 static_cast<std::size_t>(channels()) * sample_bytes;
    frame.is_whole = frame.width == width() && frame.height == height() && size >= expected;
  }
  try {
    use(frame);
  } catch (...) {
    arv_stream_push_buffer(state_->stream.get(), buffer);
    throw;
  }
  arv_stream_push_buffer(state_->stream.get(), buffer);
  return true;
}

std::uint64_t GenicamCamera::underruns() const {
  guint64 completed = 0, failed = 0, missed = 0;
  if (!state_->stream) return 0;
  arv_stream_get_statistics(state_->stream.get(), &completed, &failed, &missed);
  return missed;
}

GrayImage to_gray_image(const RawFrame& frame, int bit_depth) {
  const auto copy = [&]<class T>(Image<T> image) {
    if (frame.bytes.size() < image.size() * sizeof(T)) throw std::invalid_argument("to_gray_image: too few bytes");
    std::memcpy(image.data(), frame.bytes.data(), image.size() * sizeof(T));
    return GrayImage(std::move(image));
  };
  if (bit_depth <= 8) return copy(Image<std::uint8_t>(frame.width, frame.height));
  return copy(Image<std::uint16_t>(frame.width, frame.height));
}

}  // namespace pagesweep
