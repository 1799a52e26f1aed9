// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/kalibr_rig.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <initializer_list>
#include <string>
#include <vector>

#include "pagesweep/base/error.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/rig_fields_internal.h"
#include "pagesweep/io/words_internal.h"
#include "pagesweep/io/yaml_file.h"

namespace pagesweep {
namespace {

constexpr double mm_per_m = 1000;

std::vector<double> numbers_in(const JsonReader& json, std::size_t count) {
  auto numbers = json.numbers();
  if (numbers.size() != count) throw json.error(fmt::format("expected {} numbers, found {}", count, numbers.size()));
  return numbers;
}

/// A 4 x 4 matrix, row by row, in metres.
Rigid3 transform_in(const JsonReader& json) {
  const auto rows = json.items();
  if (rows.size() != 4) throw json.error(fmt::format("expected 4 rows, found {}", rows.size()));
  Eigen::Matrix4d matrix;
  for (int y = 0; y < 4; ++y)
    matrix.row(y) = Eigen::Map<const Eigen::RowVector4d>(numbers_in(rows[static_cast<std::size_t>(y)], 4).data());
  if (matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) throw rows[3].error("expected 0, 0, 0, 1");
  const Eigen::Vector3d translation = mm_per_m * matrix.topRightCorner<3, 1>();
  if (!(translation.cwiseAbs().maxCoeff() <= longest)) throw json.error("expected metres, found a number above 1e6");
  return {exact_rotation(matrix.topLeftCorner<3, 3>(), json), translation};
}

void expect_pinhole(const JsonReader& json) {
  const JsonReader model = json.at("camera_model");
  if (model.text() != "pinhole")
    throw model.error(
        fmt::format("expected \"pinhole\", found \"{}\", a model that our cameras do not have: calibrate "
                    "with --models pinhole-radtan",
                    model.text()));
}

BrownConrady distortion_in(const JsonReader& json) {
  const JsonReader model = json.at("distortion_model");
  if (model.text() == "none") return {};
  if (model.text() != "radtan")
    throw model.error(
        fmt::format("expected \"radtan\" or \"none\", found \"{}\", a distortion that our cameras do not "
                    "have: calibrate with --models pinhole-radtan",
                    model.text()));
  const auto d = numbers_in(json.at("distortion_coeffs"), 4);
  return {d[0], d[1], d[2], d[3], 0};
}

Camera read_camera(const JsonReader& json, std::string name) {
  expect_pinhole(json);
  Camera camera;
  camera.name = std::move(name);
  const auto size = json.at("resolution").items();
  if (size.size() != 2) throw json.at("resolution").error("expected width and height");
  camera.width = size[0].integer(1, widest_px);
  camera.height = size[1].integer(1, widest_px);
  const auto intrinsics = json.at("intrinsics").items();
  if (intrinsics.size() != 4)
    throw json.at("intrinsics").error(fmt::format("expected fu, fv, pu, pv, found {} numbers", intrinsics.size()));
  camera.fx = positive(intrinsics[0]);
  camera.fy = positive(intrinsics[1]);
  camera.cx = intrinsics[2].number(-longest, longest);
  camera.cy = intrinsics[3].number(-longest, longest);
  camera.distortion = distortion_in(json);
  return camera;
}

std::string transform_text(std::string_view name, const Rigid3& transform) {
  std::string text = fmt::format("  {}:\n", name);
  for (int y = 0; y < 3; ++y)
    text +=
        fmt::format("  - [{}, {}, {}, {}]\n", real_text(transform.rotation(y, 0)), real_text(transform.rotation(y, 1)),
                    real_text(transform.rotation(y, 2)), real_text(transform.translation[y] / mm_per_m));
  return text + "  - [0.0, 0.0, 0.0, 1.0]\n";
}

std::string list_text(std::initializer_list<double> numbers) {
  std::vector<std::string> texts;
  for (const double number : numbers) texts.push_back(real_text(number));
  return fmt::format("[{}]", fmt::join(texts, ", "));
}

/// \param topic  Kalibr asks for one
std::string intrinsics_text(const Camera& camera, std::string_view topic) {
  const BrownConrady& d = camera.distortion;
  return fmt::format(
      "  camera_model: pinhole\n  intrinsics: {}\n  distortion_model: radtan\n  distortion_coeffs: {}\n"
      "  resolution: [{}, {}]\n  rostopic: {}\n",
      list_text({camera.fx, camera.fy, camera.cx, camera.cy}), list_text({d.k1, d.k2, d.p1, d.p2}), camera.width,
      camera.height, topic);
}

bool is_camera(const JsonReader& json, const std::string& name) {
  const auto field = json.find(name);
  return name.starts_with("cam") && field && field->is_object();
}

}  // namespace

Rig read_kalibr_rig(const std::filesystem::path& file) {
  const JsonReader json = read_yaml(file);
  Rig rig;
  while (const auto item = json.find(fmt::format("cam{}", rig.cameras.size()))) {
    Camera camera = read_camera(*item, fmt::format("cam{}", rig.cameras.size()));
    if (!rig.cameras.empty())
      camera.cam_from_rig = transform_in(item->at("T_cn_cnm1")) * rig.cameras.back().cam_from_rig;
    else if (const auto place = item->find("T_cam_rig"))
      camera.cam_from_rig = transform_in(*place);
    rig.cameras.push_back(std::move(camera));
  }
  const auto names = json.names();
  const auto count = std::ranges::count_if(names, [&](const std::string& name) { return is_camera(json, name); });
  if (rig.cameras.empty() || rig.cameras.size() != static_cast<std::size_t>(count))
    throw bad_input(file, fmt::format("cam{}", rig.cameras.size()),
                    "is missing: expected a camera chain of Kalibr, cam0, cam1, ... without a gap");
  return rig;
}

void write_kalibr_rig(const std::filesystem::path& file, const Rig& rig) {
  std::string text;
  const Camera* before = nullptr;
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const Camera& camera = rig.cameras[i];
    if (camera.distortion.k3 != 0)
      throw cannot_write(file, fmt::format("{} has k3 = {}, which Kalibr's radtan has not: calibrate without it, or "
                                           "choose another format",
                                           camera.name, camera.distortion.k3));
    text += fmt::format("cam{}:\n", i) + intrinsics_text(camera, fmt::format("/cam{}/image_raw", i));
    text += before ? transform_text("T_cn_cnm1", camera.cam_from_rig * before->cam_from_rig.inverse())
                   : transform_text("T_cam_rig", camera.cam_from_rig);
    before = &camera;
  }
  write_bytes(file, text);
}

}  // namespace pagesweep
