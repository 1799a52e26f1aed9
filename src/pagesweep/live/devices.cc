// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/live/devices.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "pagesweep/io/json_file.h"
#include "pagesweep/io/json_reader.h"

namespace pagesweep {
namespace {

constexpr int largest_region = 1 << 16;
constexpr int smallest_packet = 576, largest_packet = 16'384;  // [bytes] GigE Vision's own limits

std::optional<double> number_of(const JsonReader& json, std::string_view name, double lowest, double highest) {
  const auto field = json.find(name);
  return field ? std::optional(field->number(lowest, highest)) : std::nullopt;
}

TriggerMode read_trigger(const JsonReader& json) {
  const std::string text = json.text();
  if (const auto mode = value_named<TriggerMode>(text)) return *mode;
  throw json.error(fmt::format("expected hardware, software or free-running, found \"{}\"", text));
}

void read_region(const JsonReader& json, DeviceSettings& settings) {
  settings.width = json.at("width").integer(1, largest_region);
  settings.height = json.at("height").integer(1, largest_region);
  if (const auto left = json.find("left")) settings.left = left->integer(0, largest_region);
  if (const auto top = json.find("top")) settings.top = top->integer(0, largest_region);
}

DeviceSettings read_settings(const JsonReader& json) {
  DeviceSettings settings;
  if (const auto format = json.find("pixel_format")) settings.pixel_format = format->text();
  if (const auto region = json.find("region")) read_region(*region, settings);
  settings.exposure_us = number_of(json, "exposure_us", 0, 1e8);
  settings.gain = number_of(json, "gain", -1e3, 1e6);
  settings.black_level = number_of(json, "black_level", -1e6, 1e6);
  settings.frame_rate = number_of(json, "frame_rate", 1e-3, 1e6);
  if (const auto trigger = json.find("trigger")) settings.trigger = read_trigger(*trigger);
  if (const auto line = json.find("trigger_line")) settings.trigger_line = line->text();
  if (const auto size = json.find("packet_size")) settings.packet_size = size->integer(smallest_packet, largest_packet);
  if (const auto level = json.find("dark_level")) settings.dark_level = level->number(0, 65535);
  if (const auto reversed = json.find("reversed")) settings.is_reversed = reversed->boolean();
  if (const auto rows = json.find("rows_a_buffer")) settings.rows_a_buffer = rows->integer(1, largest_region);
  return settings;
}

nlohmann::ordered_json to_json(const DeviceSettings& settings) {
  nlohmann::ordered_json json = {{"pixel_format", settings.pixel_format}};
  if (settings.width > 0)
    json["region"] = {
        {"left", settings.left}, {"top", settings.top}, {"width", settings.width}, {"height", settings.height}};
  if (settings.exposure_us) json["exposure_us"] = *settings.exposure_us;
  if (settings.gain) json["gain"] = *settings.gain;
  if (settings.black_level) json["black_level"] = *settings.black_level;
  if (settings.frame_rate) json["frame_rate"] = *settings.frame_rate;
  json["trigger"] = name_of(settings.trigger);
  if (settings.trigger == TriggerMode::hardware) json["trigger_line"] = settings.trigger_line;
  if (settings.packet_size > 0) json["packet_size"] = settings.packet_size;
  json["dark_level"] = settings.dark_level;
  if (settings.is_reversed) json["reversed"] = true;
  if (settings.rows_a_buffer != DeviceSettings().rows_a_buffer) json["rows_a_buffer"] = settings.rows_a_buffer;
  return json;
}

}  // namespace

DeviceSettings Devices::of(const std::string& name) const {
  const auto found = cameras.find(name);
  return found == cameras.end() ? DeviceSettings() : found->second;
}

Devices read_devices(const std::filesystem::path& file) {
  const JsonReader json = JsonReader::read(file);
  json.expect_format("pagesweep-devices", 1);
  const JsonReader cameras = json.at("cameras");
  Devices devices;
  for (const std::string& name : cameras.names()) devices.cameras[name] = read_settings(cameras.at(name));
  return devices;
}

void write_devices(const std::filesystem::path& file, const Devices& devices) {
  nlohmann::ordered_json json = {{"format", "pagesweep-devices"}, {"version", 1}};
  json["cameras"] = nlohmann::ordered_json::object();
  for (const auto& [name, settings] : devices.cameras) json["cameras"][name] = to_json(settings);
  write_json(file, json);
}

}  // namespace pagesweep
