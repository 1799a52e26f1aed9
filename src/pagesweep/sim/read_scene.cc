// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <type_traits>

#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/json_reader.h"
#include "pagesweep/sim/scene.h"
#include "pagesweep/sim/scene_fields.h"
#include "pagesweep/sim/viewpoint.h"

namespace pagesweep::sim {
namespace {

constexpr double degree = std::numbers::pi / 180;

/// Fields that may be left out keep their defaults.
void read(const JsonReader& json, std::string_view name, double& value, double lowest, double highest) {
  if (const auto field = json.find(name)) value = field->number(lowest, highest);
}
void read(const JsonReader& json, std::string_view name, int& value, int lowest, int highest) {
  if (const auto field = json.find(name)) value = field->integer(lowest, highest);
}
void read_angle(const JsonReader& json, std::string_view name, double& radians, double most_degrees) {
  if (const auto field = json.find(name)) radians = field->number(-most_degrees, most_degrees) * degree;
}
template <class E>
void read(const JsonReader& json, std::string_view name, E& value)
  requires std::is_enum_v<E>
{
  const auto field = json.find(name);
  if (!field) return;
  const auto named = value_named<E>(field->text());
  if (!named) throw field->error(fmt::format("expected one of {}", fmt::join(names_of(E{}), ", ")));
  value = *named;
}
std::vector<double> read_list(const JsonReader& json, std::size_t count) {
  const std::vector<double> numbers = json.numbers();
  if (numbers.size() != count) throw json.error(fmt::format("expected {} numbers, found {}", count, numbers.size()));
  return numbers;
}

Dent read_dent(const JsonReader& json) {
  Dent dent;
  const auto at = read_list(json.at("at_mm"), 2), radius = read_list(json.at("radius_mm"), 2);
  if (!(std::min(radius[0], radius[1]) >= 4)) throw json.at("radius_mm").error("expected radii of at least 4 mm");
  dent.s_mm = at[0], dent.t_mm = at[1];
  dent.radius_s_mm = radius[0], dent.radius_t_mm = radius[1];
  dent.height_mm = json.at("height_mm").number(-20, 20);
  read_angle(json, "turn_deg", dent.turn_rad, 360);
  return dent;
}

std::vector<ProfileSlope> read_slopes(const JsonReader& json) {
  std::vector<ProfileSlope> slopes;
  for (const JsonReader& item : json.items()) {
    const auto pair = read_list(item, 2);
    if (!(std::abs(pair[1]) <= 80)) throw item.error("expected a slope between -80 and 80 degrees");
    if (!slopes.empty() && !(pair[0] > slopes.back().at_mm)) throw item.error("expected a place beyond the one before");
    slopes.push_back({pair[0], pair[1] * degree});
  }
  if (slopes.empty()) throw json.error("expected at least one [place in mm, slope in degrees]");
  return slopes;
}

Curl read_curl(const JsonReader& json) {
  Curl curl;
  read(json, "corner", curl.corner);
  curl.length_mm = json.at("length_mm").number(1, 200);
  curl.radius_mm = json.at("radius_mm").number(10, 1000);
  if (!(curl.length_mm < 1.2 * curl.radius_mm))
    throw json.at("length_mm").error("expected less than 1.2 radii: the corner would hide itself");
  return curl;
}

Tear read_tear(const JsonReader& json) {
  Tear tear;
  read(json, "corner", tear.corner);
  const auto along = read_list(json.at("along_mm"), 2);
  if (!(std::min(along[0], along[1]) >= 2)) throw json.at("along_mm").error("expected at least 2 mm along both edges");
  tear.along_s_mm = along[0], tear.along_t_mm = along[1];
  return tear;
}

Crumple read_crumple(const JsonReader& json) {
  Crumple crumple;
  crumple.folds = json.at("folds").integer(1, 200);
  read_angle(json, "steepest_deg", crumple.steepest_rad, 60);
  if (!(crumple.steepest_rad > 0)) throw json.at("steepest_deg").error("expected an angle above 0");
  read(json, "roughness_mm", crumple.roughness_mm, 0.1, 30);
  read(json, "seed", crumple.seed, 0, 1 << 30);
  return crumple;
}

SheetShape read_shape(const JsonReader& json, double width_mm, double height_mm) {
  SheetShape shape;
  shape.width_mm = width_mm;
  shape.height_mm = height_mm;
  read(json, "anchor", shape.anchor);
  shape.at_mm = json.at("at_mm").vector();
  read_angle(json, "turn_deg", shape.turn_rad, 180);
  if (const auto apex = json.find("apex_mm")) {
    shape.apex_mm = apex->number();
    const double nearest = 2 * std::max(width_mm, height_mm);
    if (!(std::abs(shape.apex_mm) >= nearest && std::abs(shape.apex_mm) <= 1e6))
      throw apex->error(fmt::format("expected a distance between {} and 1e6 on either side", nearest));
  }
  if (const auto crumple = json.find("crumple")) {
    shape.crumple = read_crumple(*crumple);
    for (const char* field : {"anchor", "apex_mm", "slopes_deg", "dents", "curls"})
      if (json.find(field)) throw json.at(field).error("not for a sheet that is crumpled");
    shape.slopes = {{0, 0}};
  } else {
    shape.slopes = read_slopes(json.at("slopes_deg"));
  }
  if (const auto curls = json.find("curls"))
    for (const JsonReader& curl : curls->items()) shape.curls.push_back(read_curl(curl));
  if (const auto tears = json.find("tears"))
    for (const JsonReader& tear : tears->items()) shape.tears.push_back(read_tear(tear));
  if (const auto dents = json.find("dents"))
    for (const JsonReader& dent : dents->items()) shape.dents.push_back(read_dent(dent));
  return shape;
}

Figure read_figure(const JsonReader& json) {
  Figure figure;
  read(json, "kind", figure.kind);
  const auto at = read_list(json.at("at_mm"), 2), size = read_list(json.at("size_mm"), 2);
  if (!(std::min(size[0], size[1]) > 0)) throw json.at("size_mm").error("expected a width and a height above 0");
  figure.x_mm = at[0], figure.y_mm = at[1];
  figure.width_mm = size[0], figure.height_mm = size[1];
  return figure;
}

PrintDesign read_print(const std::optional<JsonReader>& json, double width_mm, double height_mm) {
  PrintDesign print;
  print.width_mm = width_mm;
  print.height_mm = height_mm;
  if (!json) return print;
  read(*json, "paper_albedo", print.paper_albedo, 0, 1);
  read(*json, "ink_albedo", print.ink_albedo, 0, 1);
  read(*json, "font_size_pt", print.font_size_pt, 4, 100);
  read(*json, "line_spacing", print.line_spacing, 0.8, 4);
  read(*json, "columns", print.columns, 1, 6);
  if (const auto margins = json->find("margins_mm")) {
    const auto list = read_list(*margins, 4);
    print.margin_left_mm = list[0], print.margin_right_mm = list[1];
    print.margin_top_mm = list[2], print.margin_bottom_mm = list[3];
    if (!(list[0] + list[1] < 0.9 * width_mm && list[2] + list[3] < 0.9 * height_mm))
      throw margins->error("expected margins (left, right, top, bottom) that leave room for the text");
  }
  if (const auto texts = json->find("texts"))
    for (const JsonReader& text : texts->items())
      print.texts.push_back(read_bytes(json->file().parent_path() / text.text(), 1 << 20));
  if (const auto footer = json->find("footer")) print.footer = footer->text();
  if (const auto figures = json->find("figures"))
    for (const JsonReader& figure : figures->items()) print.figures.push_back(read_figure(figure));
  return print;
}

Gloss read_gloss(const std::optional<JsonReader>& json) {
  Gloss gloss;
  if (!json) return gloss;
  gloss.strength = json->at("strength").number(0, 1);
  read(*json, "exponent", gloss.exponent, 1, 2000);
  return gloss;
}

ScenePage read_page(const JsonReader& json) {
  const double width = json.at("width_mm").number(10, 600), height = json.at("height_mm").number(10, 600);
  ScenePage page;
  page.shape = read_shape(json.at("shape"), width, height);
  page.print = read_print(json.find("print"), width, height);
  page.gloss = read_gloss(json.find("gloss"));
  if (const auto block = json.find("on_block")) page.on_block = block->boolean();
  return page;
}

SceneSphere read_sphere(const JsonReader& json) {
  SceneSphere sphere;
  sphere.center_mm = json.at("center_mm").vector();
  sphere.radius_mm = json.at("radius_mm").number(2, 100);
  read(json, "albedo", sphere.albedo, 0, 1);
  sphere.gloss = read_gloss(json.find("gloss"));
  return sphere;
}

Obstacle read_obstacle(const JsonReader& json, int pages) {
  Obstacle obstacle;
  read(json, "kind", obstacle.kind);
  const bool is_slip = obstacle.kind == ObstacleKind::slip;
  if (is_slip) obstacle.albedo = 0.8;
  read(json, "page", obstacle.page, 1, pages);
  const auto at = read_list(json.at("at_mm"), 2);
  obstacle.s_mm = at[0], obstacle.t_mm = at[1];
  read_angle(json, "turn_deg", obstacle.turn_rad, 360);
  read(json, "length_mm", obstacle.length_mm, 5, 300);
  read(json, "breadth_mm", obstacle.breadth_mm, 4, 300);
  read(json, "lift_mm", obstacle.lift_mm, 0.05, 30);
  read(json, "albedo", obstacle.albedo, 0, 1);
  return obstacle;
}

BlindArea read_blind_area(const JsonReader& json) {
  const auto list = read_list(json, 4);
  if (!(list[0] < list[2] && list[1] < list[3])) throw json.error("expected [low x, low y, high x, high y]");
  return {list[0], list[1], list[2], list[3]};
}

enum class SweepModel { translating_plane, rotating_plane };
constexpr auto names_of(SweepModel) { return std::array<std::string_view, 2>{"translating-plane", "rotating-plane"}; }

/// The sheet of light from where and how fast it moves on the table.
SceneLamp read_lamp(const JsonReader& json) {
  SceneLamp lamp;
  SweepModel model = SweepModel::translating_plane;
  double first_mm = -170, mm_per_frame = 1.7, lean = 0, skew = 0, bar_y_mm = 0;
  read(json, "model", model);
  read(json, "first_mm", first_mm, -1000, 1000);
  read(json, "mm_per_frame", mm_per_frame, -50, 50);
  if (mm_per_frame == 0) throw json.at("mm_per_frame").error("expected a speed other than 0");
  read_angle(json, "lean_deg", lean, 40);
  read_angle(json, "skew_deg", skew, 20);
  read(json, "bar_y_mm", bar_y_mm, -1000, 1000);
  read(json, "bar_height_mm", lamp.height_mm, 100, 5000);
  read(json, "bar_length_mm", lamp.length_mm, 10, 5000);
  read(json, "shape", lamp.shape);
  read(json, "fwhm_mm", lamp.fwhm_mm, 0.5, 100);
  read(json, "softness", lamp.softness, 0.1, 3);
  if (model == SweepModel::translating_plane) {
    const Eigen::Vector3d normal(std::cos(lean) * std::sin(skew), std::cos(lean) * std::cos(skew), std::sin(lean));
    lamp.light = Light(TranslatingPlane{normal, first_mm * normal.y(), mm_per_frame * normal.y()});
  } else {
    RotatingPlane plane;
    plane.axis_point = {0, bar_y_mm, lamp.height_mm};
    plane.angle0 = std::atan2(first_mm - bar_y_mm, lamp.height_mm);
    plane.angle_per_frame = mm_per_frame / lamp.height_mm;
    lamp.light = Light(plane);
  }
  return lamp;
}

Camera read_camera(const JsonReader& json, const Camera& fallback) {
  Camera camera = fallback;
  if (const auto size = json.find("size_px")) {
    const auto list = read_list(*size, 2);
    if (!(std::min(list[0], list[1]) >= 16 && std::max(list[0], list[1]) <= 20000))
      throw size->error("expected a width and a height between 16 and 20000");
    camera.width = static_cast<int>(list[0]), camera.height = static_cast<int>(list[1]);
    camera.cx = 0.5 * (camera.width - 1), camera.cy = 0.5 * (camera.height - 1);
  }
  read(json, "focal_px", camera.fx, 1, 1e6);
  camera.fy = camera.fx;
  if (const auto principal = json.find("principal_px")) {
    const auto list = read_list(*principal, 2);
    camera.cx = list[0], camera.cy = list[1];
  }
  if (const auto distortion = json.find("distortion")) {
    const auto list = read_list(*distortion, 5);
    camera.distortion = {list[0], list[1], list[2], list[3], list[4]};
  }
  if (const auto center = json.find("center_mm")) {
    double roll = 0;
    read_angle(json, "roll_deg", roll, 180);
    const Eigen::Vector3d from = center->vector(), to = json.at("target_mm").vector();
    if (!((to - from).cross(Eigen::Vector3d::UnitX()).norm() > 1))
      throw json.at("target_mm").error("expected a target that is not in direction x from the camera");
    camera.cam_from_rig = looking_at(from, to, roll);
  }
  return camera;
}

std::vector<double> read_exposures(const JsonReader& json) {
  std::vector<double> exposures;
  for (const JsonReader& item : json.items()) exposures.push_back(item.number(0.01, 100));
  if (exposures.empty() || exposures.size() > 8) throw json.error("expected 1 to 8 exposures that take turns");
  return exposures;
}

void read_cameras(const JsonReader& json, Scene& scene) {
  read(json, "frames", scene.camera.frames, 5, 10000);
  read(json, "rays_per_side", scene.camera.rays_per_side, 1, 64);
  read(json, "psf_sigma_px", scene.camera.psf_sigma_px, 0, 3);
  read(json, "ambient", scene.camera.ambient, 0, 10);
  double paper_level = 0.7;
  read(json, "paper_level", paper_level, 0.001, 100);
  scene.camera.exposure = paper_level / PrintDesign{}.paper_albedo;
  if (const auto exposures = json.find("exposures")) scene.camera.exposures = read_exposures(*exposures);
  if (const auto areas = json.find("blind_mm"))
    for (const JsonReader& area : areas->items()) scene.blind_areas.push_back(read_blind_area(area));
  const auto views = json.find("views");
  if (!views) return;
  const auto items = views->items();
  if (items.size() != 2) throw views->error("expected two cameras");
  for (std::size_t k = 0; k < 2; ++k) scene.rig.cameras[k] = read_camera(items[k], scene.rig.cameras[k]);
}

SensorModel read_sensor(const JsonReader& json) {
  SensorModel sensor;
  read(json, "bit_depth", sensor.bit_depth, 8, 16);
  sensor.black_level *= std::exp2(sensor.bit_depth - 8);
  read(json, "full_well_electrons", sensor.full_well_electrons, 10, 1e9);
  read(json, "read_noise_electrons", sensor.read_noise_electrons, 0, 1e6);
  read(json, "black_level", sensor.black_level, 0, 0.5 * sensor.highest());
  if (const auto noisy = json.find("noisy")) sensor.noisy = noisy->boolean();
  return sensor;
}

enum class ScannerModel { brown_conrady, pushbroom, rotating_line };
constexpr auto names_of(ScannerModel) {
  return std::array<std::string_view, 3>{"brown-conrady", "pushbroom", "rotating-line"};
}

/// Where a scanner is and how finely it resolves the table below it.
struct ScannerPlace {
  Eigen::Vector3d center_mm{0, 0, 700};
  double pixels_per_mm = 300 / 25.4;
  double width_mm = 420, depth_mm = 297;
  double k1 = 0;
  Eigen::Matrix3d rotation = Eigen::Vector3d(1, -1, -1).asDiagonal();
  int width() const { return static_cast<int>(width_mm * pixels_per_mm); }
  int height() const { return static_cast<int>(depth_mm * pixels_per_mm); }
  double focal_px() const { return pixels_per_mm * center_mm.z(); }
};

Scanner make_camera_scanner(const ScannerPlace& place) {
  Camera camera;
  camera.name = "scanner";
  camera.width = place.width();
  camera.height = place.height();
  camera.fx = camera.fy = place.focal_px();
  camera.cx = 0.5 * (place.width() - 1), camera.cy = 0.5 * (place.height() - 1);
  camera.distortion.k1 = place.k1;
  camera.cam_from_rig = {place.rotation, -(place.rotation * place.center_mm)};
  return Scanner(camera);
}

template <class Line>
Line make_line(const ScannerPlace& place) {
  Line line;
  line.width = place.width();
  line.f = place.focal_px();
  line.cx = 0.5 * (place.width() - 1);
  line.k1 = place.k1;
  line.rotation = place.rotation;
  line.center = place.center_mm;
  return line;
}

Scanner make_pushbroom(const ScannerPlace& place) {
  auto line = make_line<Pushbroom>(place);
  line.height = place.height();
  line.step = {0, -1 / place.pixels_per_mm, 0};
  line.center -= 0.5 * (line.height - 1) * line.step;
  return Scanner(line);
}

Scanner make_rotating_line(const ScannerPlace& place) {
  auto line = make_line<RotatingLine>(place);
  const double half_angle = std::atan(0.5 * place.depth_mm / place.center_mm.z());
  line.angle_step = 1 / place.focal_px();
  line.height = static_cast<int>(2 * half_angle / line.angle_step);
  line.angle0 = -0.5 * (line.height - 1) * line.angle_step;
  return Scanner(line);
}

void read_scanner(const JsonReader& json, Scene& scene) {
  ScannerModel model = ScannerModel::pushbroom;
  ScannerPlace place;
  read(json, "model", model);
  if (const auto center = json.find("center_mm")) place.center_mm = center->vector();
  if (!(place.center_mm.z() >= 100)) throw json.at("center_mm").error("expected a height of at least 100 mm");
  double dpi = 300;
  read(json, "dpi", dpi, 20, 2400);
  place.pixels_per_mm = dpi / 25.4;
  if (const auto size = json.find("size_mm")) {
    const auto list = read_list(*size, 2);
    if (!(std::min(list[0], list[1]) >= 10 && std::max(list[0], list[1]) <= 2000))
      throw size->error("expected a width and a depth between 10 and 2000");
    place.width_mm = list[0], place.depth_mm = list[1];
  }
  read(json, "k1", place.k1, -1, 1);
  read(json, "bit_depth", scene.scan.bit_depth, 8, 16);
  if (scene.scan.bit_depth != 8 && scene.scan.bit_depth != 16) throw json.at("bit_depth").error("expected 8 or 16");
  read(json, "rays_per_side", scene.scan.rays_per_side, 1, 16);
  read(json, "noise", scene.scan.noise, 0, 1);
  switch (model) {
    case ScannerModel::brown_conrady:
      scene.rig.scanner = make_camera_scanner(place);
      break;
    case ScannerModel::pushbroom:
      scene.rig.scanner = make_pushbroom(place);
      break;
    case ScannerModel::rotating_line:
      scene.rig.scanner = make_rotating_line(place);
      break;
  }
}

}  // namespace

Scene read_scene(const std::filesystem::path& file) {
  const JsonReader json = JsonReader::read(file);
  json.expect_format("pagesweep-scene", 1);
  require_known_scene_fields(file);
  Scene scene;
  scene.rig = make_default_rig();
  if (const auto about = json.find("about")) scene.about = about->text();
  if (const auto pages = json.find("pages"))
    for (const JsonReader& page : pages->items()) scene.pages.push_back(read_page(page));
  if (const auto spheres = json.find("spheres"))
    for (const JsonReader& sphere : spheres->items()) scene.spheres.push_back(read_sphere(sphere));
  if (const auto obstacles = json.find("obstacles"))
    for (const JsonReader& obstacle : obstacles->items())
      scene.obstacles.push_back(read_obstacle(obstacle, static_cast<int>(scene.pages.size())));
  if (scene.pages.empty() && scene.spheres.empty())
    throw json.error("expected pages or spheres: there is nothing to scan");
  if (const auto table = json.find("table")) read(*table, "albedo", scene.table_albedo, 0, 1);
  if (const auto lamp = json.find("lamp")) scene.lamp = read_lamp(*lamp);
  if (const auto cameras = json.find("cameras")) read_cameras(*cameras, scene);
  if (const auto sensor = json.find("sensor")) scene.sensor = read_sensor(*sensor);
  if (const auto scanner = json.find("scanner")) read_scanner(*scanner, scene);
  return scene;
}

}  // namespace pagesweep::sim
