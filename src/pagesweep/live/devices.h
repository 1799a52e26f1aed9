// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "pagesweep/base/enum_names.h"

namespace pagesweep {

/// What starts a camera's exposures.
enum class TriggerMode {
  hardware,      ///< a line that is wired to all cameras
  software,      ///< a command from this computer to each camera
  free_running,  ///< each camera's own clock
};
constexpr auto names_of(TriggerMode) { return std::array<std::string_view, 3>{"hardware", "software", "free-running"}; }

/// How one camera is to be set; what is not given stays as the camera has it.
struct DeviceSettings {
  std::string pixel_format = "Mono8";
  int width = 0, height = 0;  ///< [px] of the region; 0: as the rig says
  int left = 0, top = 0;      ///< [px] of the region
  std::optional<double> exposure_us;
  std::optional<double> gain;         ///< in the camera's own unit
  std::optional<double> black_level;  ///< in the camera's own unit
  std::optional<double> frame_rate;   ///< [Hz]; of a line camera: buffers a second
  TriggerMode trigger = TriggerMode::hardware;
  std::string trigger_line = "Line0";
  int packet_size = 0;       ///< [bytes] of a network packet; 0: the largest that the way allows
  double dark_level = 0;     ///< gray value without light, for capture.json
  bool is_reversed = false;  ///< of a line camera: its first row belongs at the scan's end
  int rows_a_buffer = 128;   ///< of a line camera
};

/// devices.json: how each camera of a rig is set, by its name in the rig; "line" is the scanner's line camera.
struct Devices {
  std::map<std::string, DeviceSettings> cameras;

  /// Those of a camera; defaults if nothing is said about it.
  DeviceSettings of(const std::string& name) const;
};

/// \throws Error  that names file, field and what was expected
Devices read_devices(const std::filesystem::path& file);
/// \throws Error  if it cannot be written
void write_devices(const std::filesystem::path& file, const Devices& devices);

}  // namespace pagesweep
