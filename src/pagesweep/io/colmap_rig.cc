// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/colmap_rig.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <map>
#include <vector>

#include "pagesweep/base/error.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/rig_fields_internal.h"
#include "pagesweep/io/words_internal.h"

namespace pagesweep {
namespace {

constexpr std::size_t most_bytes = std::size_t{1} << 30;  ///< images.txt holds all image points
constexpr std::size_t most_cameras = 100;
constexpr double pixel_center = 0.5;  ///< of the top-left pixel, in COLMAP's coordinates
constexpr double unit_length_tolerance = 1e-4;

/// A line of a file that knows its place.
class Line {
 public:
  Line(const std::filesystem::path& file, int number, std::string_view text)
      : file_(file), number_(number), words_(words_of(text)) {}

  bool is_comment() const { return words_.empty() || words_[0].starts_with('#'); }
  std::size_t size() const { return words_.size(); }
  std::string_view word(std::size_t i) const { return words_[i]; }
  double number(std::size_t i) const {
    const auto value = number_in(words_[i]);
    if (!value || !(std::abs(*value) <= longest))
      throw error(fmt::format("expected a number from -1e9 to 1e9, found \"{}\"", words_[i].substr(0, 40)));
    return *value;
  }
  int integer(std::size_t i, int lowest, int highest) const {
    const double value = number(i);
    if (value != std::floor(value) || !(value >= lowest && value <= highest))
      throw error(fmt::format("expected a whole number from {} to {}, found {}", lowest, highest, value));
    return static_cast<int>(value);
  }
  /// A number that only tells apart.
  std::string id(std::size_t i) const { return std::string(words_[i]); }
  Error error(const std::string& problem) const { return bad_input(file_, fmt::format("line {}", number_), problem); }

 private:
  const std::filesystem::path& file_;
  int number_;
  std::vector<std::string_view> words_;
};

/// Takes one line after the other out of a file.
class Lines {
 public:
  explicit Lines(const std::filesystem::path& file) : file_(file), text_(read_bytes(file, most_bytes)), rest_(text_) {}
  Lines(const Lines&) = delete;
  Lines& operator=(const Lines&) = delete;

  /// The next line that says something; nothing at the end.
  std::optional<Line> next() {
    while (!rest_.empty()) {
      if (Line line = below(); !line.is_comment()) return line;
    }
    return std::nullopt;
  }
  /// The line below, whatever it says.
  Line below() {
    ++number_;
    return {file_, number_, take()};
  }

 private:
  std::string_view take() {
    const auto end = rest_.find('\n');
    const auto line = rest_.substr(0, end);
    rest_ = end == std::string_view::npos ? std::string_view() : rest_.substr(end + 1);
    return line;
  }

  const std::filesystem::path& file_;
  std::string text_;
  std::string_view rest_;
  int number_ = 0;
};

struct Model {
  std::string_view name;
  std::size_t parameters;
  bool one_focal_length;
};
constexpr std::array<Model, 6> models = {{{"SIMPLE_PINHOLE", 3, true},
                                          {"PINHOLE", 4, false},
                                          {"SIMPLE_RADIAL", 4, true},
                                          {"RADIAL", 5, true},
                                          {"OPENCV", 8, false},
                                          {"FULL_OPENCV", 12, false}}};

const Model& model_of(const Line& line) {
  for (const Model& model : models)
    if (line.word(1) == model.name) return model;
  throw line.error(fmt::format(
      "expected SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL or OPENCV, found {}, a model that our cameras "
      "do not have: let COLMAP adjust the model again with --ImageReader.camera_model OPENCV",
      line.word(1).substr(0, 40)));
}

/// CAMERA_ID MODEL WIDTH HEIGHT PARAMS...; parameters are the focal lengths, the principal point, then k1 k2 p1 p2 k3
/// k4 k5 k6 as far as the model has them.
Camera camera_in(const Line& line) {
  if (line.size() < 5) throw line.error("expected a camera: CAMERA_ID MODEL WIDTH HEIGHT PARAMS...");
  const Model& model = model_of(line);
  std::vector<double> p;
  for (std::size_t i = 4; i < line.size(); ++i) p.push_back(line.number(i));
  if (p.size() != model.parameters)
    throw line.error(fmt::format("expected {} parameters of {}, found {}", model.parameters, model.name, p.size()));
  if (model.one_focal_length) p.insert(p.begin(), p[0]);
  p.resize(12, 0);
  if (!(p[0] > 0 && p[1] > 0)) throw line.error("expected a focal length above 0");
  if (p[9] != 0 || p[10] != 0 || p[11] != 0)
    throw line.error("expected k4 = k5 = k6 = 0, which our cameras do not have: use the model OPENCV");
  Camera camera;
  camera.width = line.integer(2, 1, widest_px);
  camera.height = line.integer(3, 1, widest_px);
  camera.fx = p[0], camera.fy = p[1];
  camera.cx = p[2] - pixel_center, camera.cy = p[3] - pixel_center;
  camera.distortion = {p[4], p[5], p[6], p[7], p[8]};
  return camera;
}

std::map<std::string, Camera> read_cameras(const std::filesystem::path& file) {
  std::map<std::string, Camera> cameras;
  Lines lines(file);
  while (const auto line = lines.next())
    if (!cameras.emplace(line->id(0), camera_in(*line)).second)
      throw line->error(fmt::format("expected another CAMERA_ID: there is a camera {} already", line->word(0)));
  return cameras;
}

Rigid3 pose_in(const Line& line, double mm_per_unit) {
  Eigen::Quaterniond q(line.number(1), line.number(2), line.number(3), line.number(4));
  if (!(std::abs(q.norm() - 1) <= unit_length_tolerance))
    throw line.error(fmt::format("expected a quaternion QW QX QY QZ of length 1, found length {}", q.norm()));
  q.normalize();
  const Eigen::Vector3d t = mm_per_unit * Eigen::Vector3d(line.number(5), line.number(6), line.number(7));
  if (!(t.cwiseAbs().maxCoeff() <= longest)) throw line.error("expected lengths up to 1e9 mm");
  return {q.toRotationMatrix(), t};
}

/// "left/000.png" names the camera "left_000".
std::string camera_name(const Line& line) {
  std::string name(line.word(9));
  const auto slash = name.rfind('/'), dot = name.rfind('.');
  if (dot != std::string::npos && dot > (slash == std::string::npos ? 0 : slash + 1)) name.resize(dot);
  std::ranges::replace(name, '/', '_');
  if (!is_camera_name(name)) throw line.error("expected an image's name that can name a camera: no leading dot");
  return name;
}

/// IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME
Camera image_in(const Line& line, const std::map<std::string, Camera>& cameras, double mm_per_unit) {
  if (line.size() < 10)
    throw line.error(
        "expected an image: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, and a line of points after each");
  const auto intrinsics = cameras.find(line.id(8));
  if (intrinsics == cameras.end())
    throw line.error(fmt::format("expected a CAMERA_ID of cameras.txt, found {}", line.word(8).substr(0, 40)));
  Camera camera = intrinsics->second;
  camera.name = camera_name(line);
  camera.cam_from_rig = pose_in(line, mm_per_unit);
  return camera;
}

std::string camera_text(std::size_t id, const Camera& camera) {
  const BrownConrady& d = camera.distortion;
  std::vector<double> p = {camera.fx, camera.fy, camera.cx + pixel_center, camera.cy + pixel_center, d.k1, d.k2,
                           d.p1,      d.p2};
  if (d.k3 != 0) p.insert(p.end(), {d.k3, 0, 0, 0});
  return fmt::format("{} {} {} {} {}\n", id, d.k3 != 0 ? "FULL_OPENCV" : "OPENCV", camera.width, camera.height,
                     fmt::join(p, " "));
}

/// The camera's pose, and an empty line where image points would be.
std::string image_text(std::size_t id, const Camera& camera, double mm_per_unit) {
  const Eigen::Quaterniond q(camera.cam_from_rig.rotation);
  const Eigen::Vector3d t = camera.cam_from_rig.translation / mm_per_unit;
  return fmt::format("{0} {1} {2} {3} {4} {5} {6} {7} {0} {8}.png\n\n", id, q.w(), q.x(), q.y(), q.z(), t.x(), t.y(),
                     t.z(), camera.name);
}

}  // namespace

Rig read_colmap_rig(const std::filesystem::path& cameras_file, const std::filesystem::path& images_file,
                    double mm_per_unit) {
  const auto cameras = read_cameras(cameras_file);
  Rig rig;
  Lines lines(images_file);
  while (const auto line = lines.next()) {
    Camera camera = image_in(*line, cameras, mm_per_unit);
    if (const Line points = lines.below(); !points.is_comment() && points.size() % 3 != 0)
      throw points.error("expected the image points of the line above, X Y POINT3D_ID each, or an empty line");
    if (rig.find_camera(camera.name))
      throw line->error(fmt::format("expected another name: there is a camera \"{}\" already", camera.name));
    if (rig.cameras.size() == most_cameras)
      throw line->error(
          fmt::format("expected one image a camera of the rig, found more than {}: leave in the file the "
                      "images of one moment",
                      most_cameras));
    rig.cameras.push_back(std::move(camera));
  }
  if (rig.cameras.empty()) throw bad_input(images_file, "", "expected at least one image");
  return rig;
}

void write_colmap_rig(const std::filesystem::path& folder, const Rig& rig, double mm_per_unit) {
  std::error_code error;
  if (std::filesystem::exists(folder, error) && !std::filesystem::is_empty(folder, error))
    throw cannot_write(folder, "it is there already, and a model of COLMAP is never overwritten: name a new folder");
  std::string cameras = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS...\n";
  std::string images = "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then a line of image points\n";
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const Camera& camera = rig.cameras[i];
    if (words_of(camera.name) != std::vector<std::string_view>{camera.name} ||
        camera.name.find('\n') != std::string::npos)
      throw cannot_write(folder, fmt::format("COLMAP ends names at blanks: rename the camera \"{}\"", camera.name));
    cameras += camera_text(i + 1, camera);
    images += image_text(i + 1, camera, mm_per_unit);
  }
  const NamedText files[] = {{"cameras.txt", cameras}, {"images.txt", images}, {"points3D.txt", "# no points\n"}};
  write_together(folder, files);
}

}  // namespace pagesweep
