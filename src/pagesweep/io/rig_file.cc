// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/rig_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "pagesweep/io/json_file.h"
#include "pagesweep/io/json_reader.h"
#include "pagesweep/io/rig_fields_internal.h"

namespace pagesweep {
namespace {

using nlohmann::ordered_json;

double number_or_zero(const JsonReader& json, std::string_view name) {
  const auto field = json.find(name);
  return field ? field->number(-longest, longest) : 0;
}

double not_zero(const JsonReader& json) {
  const double value = json.number(-longest, longest);
  if (value == 0) throw json.error("expected a number other than 0");
  return value;
}

Eigen::Vector3d place_of(const JsonReader& json) {
  const Eigen::Vector3d point = json.vector();
  if (point.cwiseAbs().maxCoeff() > longest) throw json.error("expected millimetres, found a number above 1e9");
  return point;
}

template <class Model>
void read_size(const JsonReader& json, Model& model) {
  model.width = json.at("width").integer(1, widest_px);
  model.height = json.at("height").integer(1, widest_px);
}

Camera read_brown_conrady(const JsonReader& json) {
  Camera camera;
  read_size(json, camera);
  camera.fx = positive(json.at("fx"));
  camera.fy = positive(json.at("fy"));
  camera.cx = json.at("cx").number(-longest, longest);
  camera.cy = json.at("cy").number(-longest, longest);
  camera.distortion = {number_or_zero(json, "k1"), number_or_zero(json, "k2"), number_or_zero(json, "p1"),
                       number_or_zero(json, "p2"), number_or_zero(json, "k3")};
  camera.cam_from_rig = {json.at("rotation").rotation(), place_of(json.at("translation"))};
  return camera;
}

CameraSensor read_sensor(const JsonReader& json) {
  return {positive(json.at("gain")), json.at("read_noise").number(0, longest),
          json.at("psf_sigma_px").number(0, longest)};
}

Camera read_camera(const JsonReader& json) {
  const JsonReader model = json.at("model");
  if (model.text() != "brown-conrady")
    throw model.error(fmt::format("expected \"brown-conrady\", found \"{}\"", model.text()));
  Camera camera = read_brown_conrady(json);
  const JsonReader name = json.at("name");
  camera.name = name.text();
  if (!is_camera_name(camera.name))
    throw name.error("expected a name that can begin a file's name: not empty, no slash, no leading dot");
  if (const auto sensor = json.find("sensor")) camera.sensor = read_sensor(*sensor);
  return camera;
}

/// What both line scanners have.
template <class Line>
Line read_line_scanner(const JsonReader& json) {
  Line line;
  read_size(json, line);
  line.f = positive(json.at("f"));
  line.cx = json.at("cx").number(-longest, longest);
  line.k1 = number_or_zero(json, "k1");
  line.rotation = json.at("rotation").rotation();
  line.center = place_of(json.at("center"));
  return line;
}

Scanner read_scanner(const JsonReader& json) {
  const JsonReader model = json.at("model");
  const std::string name = model.text();
  if (name == "brown-conrady") {
    Camera camera = read_brown_conrady(json);
    camera.name = "scanner";
    return Scanner(camera);
  }
  if (name == "pushbroom") {
    auto line = read_line_scanner<Pushbroom>(json);
    line.step = place_of(json.at("step"));
    if (!((line.rotation * line.step).y() != 0))
      throw json.at("step").error("expected a step across the sensor line, found none: rows would coincide");
    return Scanner(line);
  }
  if (name == "rotating-line") {
    auto line = read_line_scanner<RotatingLine>(json);
    line.angle0 = json.at("angle0").number(-longest, longest);
    line.angle_step = not_zero(json.at("angle_step"));
    return Scanner(line);
  }
  throw model.error(fmt::format(R"(expected "brown-conrady", "pushbroom" or "rotating-line", found "{}")", name));
}

RotatingPlane read_rotating_plane(const JsonReader& json) {
  RotatingPlane light;
  light.axis_point = place_of(json.at("axis_point"));
  light.axis = json.at("axis").unit_vector();
  light.normal0 = json.at("normal0").unit_vector();
  const double along_axis = light.axis.dot(light.normal0);
  if (std::abs(along_axis) > 1e-4)
    throw json.at("normal0").error(
        fmt::format("expected a normal perpendicular to axis, found a cosine of {}", along_axis));
  if (std::abs(along_axis) > 1e-14) light.normal0 = (light.normal0 - along_axis * light.axis).normalized();
  light.angle0 = json.at("angle0").number(-longest, longest);
  light.angle_per_frame = not_zero(json.at("angle_per_frame"));
  return light;
}

RecordedPlanes read_recorded_planes(const JsonReader& json) {
  RecordedPlanes light;
  light.first_frame = json.at("first_frame").integer(-1000000, 1000000);
  for (const JsonReader& item : json.at("planes").items())
    light.planes.push_back({item.at("normal").unit_vector(), item.at("offset").number(-longest, longest)});
  if (light.planes.size() < 2)
    throw json.at("planes").error(fmt::format("expected at least 2 planes, found {}", light.planes.size()));
  return light;
}

Light read_light(const JsonReader& json) {
  const JsonReader model = json.at("model");
  if (model.text() == "recorded-planes") return Light(read_recorded_planes(json));
  if (model.text() == "rotating-plane") return Light(read_rotating_plane(json));
  if (model.text() != "translating-plane")
    throw model.error(fmt::format(R"(expected "translating-plane", "rotating-plane" or "recorded-planes", found "{}")",
                                  model.text()));
  return Light(TranslatingPlane{json.at("normal").unit_vector(), json.at("offset").number(-longest, longest),
                                not_zero(json.at("offset_per_frame"))});
}

LampBar read_lamp(const JsonReader& json) {
  return {positive(json.at("height")), positive(json.at("length")), number_or_zero(json, "center")};
}

WhiteReference read_white(const JsonReader& json) {
  constexpr int most = 1000;
  WhiteReference white;
  white.height_mm = number_or_zero(json, "height");
  white.columns = json.at("columns").integer(2, most);
  white.rows = json.at("rows").integer(2, most);
  const JsonReader light = json.at("light");
  for (const JsonReader& node : light.items()) {
    std::array<float, 3>& values = white.light.emplace_back();
    const auto channels = node.items();
    if (channels.size() != values.size()) throw node.error("expected three numbers: red, green and blue");
    std::transform(channels.begin(), channels.end(), values.begin(),
                   [](const JsonReader& value) { return static_cast<float>(positive(value)); });
  }
  if (const int nodes = white.columns * white.rows; static_cast<int>(white.light.size()) != nodes)
    throw light.error(fmt::format("expected columns x rows = {} nodes, found {}", nodes, white.light.size()));
  return white;
}

ordered_json to_json(const LampBar& lamp) {
  return {{"height", lamp.height_mm}, {"length", lamp.length_mm}, {"center", lamp.center_mm}};
}

ordered_json to_json(const WhiteReference& white) {
  ordered_json json = {
      {"height", white.height_mm}, {"columns", white.columns}, {"rows", white.rows}, {"light", ordered_json::array()}};
  for (const auto& node : white.light) {
    ordered_json values = ordered_json::array();
    for (const float value : node) values.push_back(std::round(double(value) * 1e5) / 1e5);
    json["light"].push_back(std::move(values));
  }
  return json;
}

ordered_json to_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

ordered_json to_json(const Eigen::Matrix3d& m) {
  ordered_json rows = ordered_json::array();
  for (int i = 0; i < 9; ++i) rows.push_back(m(i / 3, i % 3));
  return rows;
}

ordered_json to_json(const Camera& camera) {
  const BrownConrady& d = camera.distortion;
  return {{"model", "brown-conrady"},
          {"width", camera.width},
          {"height", camera.height},
          {"fx", camera.fx},
          {"fy", camera.fy},
          {"cx", camera.cx},
          {"cy", camera.cy},
          {"k1", d.k1},
          {"k2", d.k2},
          {"p1", d.p1},
          {"p2", d.p2},
          {"k3", d.k3},
          {"rotation", to_json(camera.cam_from_rig.rotation)},
          {"translation", to_json(camera.cam_from_rig.translation)}};
}

ordered_json to_json(const CameraSensor& sensor) {
  return {{"gain", sensor.gain}, {"read_noise", sensor.read_noise}, {"psf_sigma_px", sensor.psf_sigma_px}};
}

template <class Line>
ordered_json line_to_json(std::string_view model, const Line& line) {
  return {{"model", model},
          {"width", line.width},
          {"height", line.height},
          {"f", line.f},
          {"cx", line.cx},
          {"k1", line.k1},
          {"rotation", to_json(line.rotation)},
          {"center", to_json(line.center)}};
}

ordered_json to_json(const Pushbroom& line) {
  ordered_json json = line_to_json("pushbroom", line);
  json["step"] = to_json(line.step);
  return json;
}

ordered_json to_json(const RotatingLine& line) {
  ordered_json json = line_to_json("rotating-line", line);
  json["angle0"] = line.angle0;
  json["angle_step"] = line.angle_step;
  return json;
}

ordered_json to_json(const TranslatingPlane& light) {
  return {{"model", "translating-plane"},
          {"normal", to_json(light.normal)},
          {"offset", light.offset},
          {"offset_per_frame", light.offset_per_frame}};
}

ordered_json to_json(const RotatingPlane& light) {
  return {{"model", "rotating-plane"},   {"axis_point", to_json(light.axis_point)},
          {"axis", to_json(light.axis)}, {"normal0", to_json(light.normal0)},
          {"angle0", light.angle0},      {"angle_per_frame", light.angle_per_frame}};
}

ordered_json to_json(const RecordedPlanes& light) {
  ordered_json planes = ordered_json::array();
  for (const Plane& plane : light.planes)
    planes.push_back({{"normal", to_json(plane.normal)}, {"offset", plane.offset}});
  return {{"model", "recorded-planes"}, {"first_frame", light.first_frame}, {"planes", planes}};
}

void require_finite(const ordered_json& json) {
  if (json.is_number_float() && !std::isfinite(json.get<double>()))
    throw std::invalid_argument("write_rig: a number of the rig is not finite");
  if (json.is_structured())
    for (const auto& item : json) require_finite(item);
}

}  // namespace

Rig read_rig(const std::filesystem::path& file) {
  const JsonReader json = JsonReader::read(file);
  json.expect_format("pagesweep-rig", 1);
  Rig rig;
  for (const JsonReader& item : json.at("cameras").items()) {
    Camera camera = read_camera(item);
    if (rig.find_camera(camera.name))
      throw item.at("name").error(fmt::format("expected another name: there is a camera \"{}\" already", camera.name));
    rig.cameras.push_back(std::move(camera));
  }
  if (rig.cameras.empty()) throw json.at("cameras").error("expected at least one camera");
  if (const auto scanner = json.find("scanner")) rig.scanner = read_scanner(*scanner);
  if (const auto light = json.find("light")) rig.light = read_light(*light);
  if (const auto lamp = json.find("lamp")) rig.lamp = read_lamp(*lamp);
  if (const auto white = json.find("white")) rig.white = read_white(*white);
  return rig;
}

void write_rig(const std::filesystem::path& file, const Rig& rig) {
  ordered_json json = {{"format", "pagesweep-rig"}, {"version", 1}, {"cameras", ordered_json::array()}};
  for (const Camera& camera : rig.cameras) {
    ordered_json item = {{"name", camera.name}};
    item.update(to_json(camera));
    if (camera.sensor) item["sensor"] = to_json(*camera.sensor);
    json["cameras"].push_back(item);
  }
  const auto convert = [](const auto& model) { return to_json(model); };
  if (rig.scanner) json["scanner"] = std::visit(convert, rig.scanner->model());
  if (rig.light) json["light"] = std::visit(convert, rig.light->model());
  if (rig.lamp) json["lamp"] = to_json(*rig.lamp);
  if (rig.white) json["white"] = to_json(*rig.white);
  require_finite(json);
  write_json(file, json);
}

}  // namespace pagesweep
