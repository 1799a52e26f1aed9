// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "pagesweep/live/devices.h"
#include "pagesweep/live/live_frame.h"

namespace pagesweep {

/// A camera that is connected.
struct FoundCamera {
  std::string id;  ///< to open it with
  std::string vendor, model, serial, address, protocol;
  int sensor_width = 0, sensor_height = 0;  ///< [px]; 0: it could not be asked
  std::vector<std::string> pixel_formats;
  std::string problem;  ///< why it could not be asked; empty: it could
};

/// All cameras that answer, on the network and on USB.
std::vector<FoundCamera> find_cameras();

/// Why a camera that should be there does not answer, and what to do, in words.
/// \param id  its network address, or as find_cameras() told it before
std::string why_missing(const std::string& id);

/// What came in one buffer. Its pixels last as long as the call that hands it over.
struct RawFrame {
  bool is_whole = false;  ///< else packets are missing
  std::uint64_t id = 0;
  std::int64_t timestamp_ns = 0;
  Clock::time_point arrival;
  int width = 0, height = 0;         ///< [px]
  std::span<const std::byte> bytes;  ///< row by row
};

/// One camera that speaks GenICam, by GigE Vision or USB3 Vision: opened, set and streaming.
class GenicamCamera {
 public:
  /// Opens and sets it.
  /// \param name  in the rig, for messages
  /// \param id    as find_cameras() tells, or a network address
  /// \throws Error  if it is missing, taken, or cannot do what is asked for
  GenicamCamera(std::string name, const std::string& id, const DeviceSettings& settings);
  ~GenicamCamera();
  GenicamCamera(const GenicamCamera&) = delete;
  GenicamCamera& operator=(const GenicamCamera&) = delete;

  const std::string& name() const;
  /// What the operator should know: a packet size that is too small, a value that the camera has rounded.
  const std::vector<std::string>& remarks() const;
  int channels() const;   ///< of its pixels: 1 or 3
  int bit_depth() const;  ///< of its samples: 1 to 16
  int width() const;
  int height() const;
  /// The settings as the camera took them.
  const DeviceSettings& settings() const;

  void start();
  void stop();
  /// Never speaks to it again, not even to take leave: one that is gone would be waited for for seconds. What it takes
  /// stays allocated.
  void abandon();
  /// Exposes a frame, where the trigger is software.
  void trigger();
  /// Waits for the next buffer.
  /// \return whether one came
  bool receive(std::chrono::milliseconds longest, const std::function<void(const RawFrame&)>& use);
  /// Frames that the computer could not take in time.
  std::uint64_t underruns() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The pixels of a frame as gray values.
/// \throws std::invalid_argument  if it has several channels
GrayImage to_gray_image(const RawFrame& frame, int bit_depth);

}  // namespace pagesweep
