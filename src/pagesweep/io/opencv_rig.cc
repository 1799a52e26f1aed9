// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/opencv_rig.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "pagesweep/base/error.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/rig_fields_internal.h"
#include "pagesweep/io/words_internal.h"
#include "pagesweep/io/yaml_file.h"

namespace pagesweep {
namespace {

constexpr int most_coefficients = 14;
constexpr const char* first_line = "%YAML:1.0\n---\n";

using Documents = std::vector<JsonReader>;

/// The first field of that name in any of the files.
std::optional<JsonReader> find_in(const Documents& documents, std::string_view name) {
  for (const JsonReader& document : documents)
    if (auto field = document.find(name)) return field;
  return std::nullopt;
}

/// "intrinsics.yml, extrinsics.yml", for what none of them says.
std::string all_files(const Documents& documents) {
  std::vector<std::string> names;
  for (const JsonReader& document : documents) names.push_back(document.file().string());
  return fmt::format("{}", fmt::join(names, ", "));
}

JsonReader need(const Documents& documents, const std::string& name, std::string_view what) {
  if (auto field = find_in(documents, name)) return *std::move(field);
  throw bad_input(all_files(documents), name, fmt::format("is missing: expected {}", what));
}

/// A cv::Mat in a file has `rows`, `cols` and `data`, row by row.
Eigen::MatrixXd matrix_in(const JsonReader& json) {
  const int rows = json.at("rows").integer(1, most_coefficients), cols = json.at("cols").integer(1, most_coefficients);
  const auto data = json.at("data").numbers();
  if (std::ssize(data) != rows * cols)
    throw json.at("data").error(
        fmt::format("expected {} numbers for {} x {}, found {}", rows * cols, rows, cols, data.size()));
  return Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(data.data(), rows,
                                                                                                  cols);
}

Eigen::Matrix3d matrix3_in(const JsonReader& json) {
  const Eigen::MatrixXd matrix = matrix_in(json);
  if (matrix.rows() != 3 || matrix.cols() != 3)
    throw json.error(fmt::format("expected a 3 x 3 matrix, found {} x {}", matrix.rows(), matrix.cols()));
  return matrix;
}

/// A row or a column.
Eigen::VectorXd vector_in(const JsonReader& json) {
  const Eigen::MatrixXd matrix = matrix_in(json);
  if (matrix.rows() != 1 && matrix.cols() != 1)
    throw json.error(fmt::format("expected a row or a column, found {} x {}", matrix.rows(), matrix.cols()));
  return matrix.reshaped();
}

Rigid3 pose_in(const JsonReader& rotation, const JsonReader& translation, double mm_per_unit) {
  const Eigen::VectorXd t = mm_per_unit * vector_in(translation);
  if (t.size() != 3) throw translation.error(fmt::format("expected 3 numbers, found {}", t.size()));
  if (!(t.cwiseAbs().maxCoeff() <= longest)) throw translation.error("expected lengths up to 1e9 mm");
  return {exact_rotation(matrix3_in(rotation), rotation), t};
}

void read_camera_matrix(const JsonReader& json, Camera& camera) {
  const Eigen::Matrix3d k = matrix3_in(json);
  camera.fx = k(0, 0), camera.fy = k(1, 1), camera.cx = k(0, 2), camera.cy = k(1, 2);
  if (!(std::min(camera.fx, camera.fy) > 0) || !(k.cwiseAbs().maxCoeff() <= longest) || k(0, 1) != 0 || k(1, 0) != 0 ||
      k(2, 0) != 0 || k(2, 1) != 0 || k(2, 2) != 1)
    throw json.error("expected the matrix fx 0 cx, 0 fy cy, 0 0 1 with focal lengths above 0 and no skew");
}

BrownConrady distortion_in(const JsonReader& json) {
  const Eigen::VectorXd d = vector_in(json);
  constexpr std::array counts = {4, 5, 8, 12, 14};
  if (std::ranges::find(counts, d.size()) == counts.end())
    throw json.error(fmt::format("expected {} coefficients, found {}", fmt::join(counts, ", "), d.size()));
  if (d.size() > 5 && !d.tail(d.size() - 5).isZero(0))
    throw json.error(
        "expected k1 k2 p1 p2 k3 and zeros, found more coefficients, which our cameras do not have: calibrate "
        "without CALIB_RATIONAL_MODEL, CALIB_THIN_PRISM_MODEL and CALIB_TILTED_MODEL");
  return {d[0], d[1], d[2], d[3], d.size() > 4 ? d[4] : 0};
}

void read_size(const JsonReader& document, const OpenCvHints& hints, Camera& camera) {
  const auto width = document.find("image_width"), height = document.find("image_height");
  if (!width && !height && hints.width == 0)
    throw bad_input(document.file(), "image_width",
                    "is missing: OpenCV's stereo sample leaves the pictures' size out, so it has to be given "
                    "(--image-size 1024x768)");
  camera.width = width || height ? document.at("image_width").integer(1, widest_px) : hints.width;
  camera.height = width || height ? document.at("image_height").integer(1, widest_px) : hints.height;
  if (hints.width != 0 && (hints.width != camera.width || hints.height != camera.height))
    throw bad_input(document.file(), "image_width",
                    fmt::format("expected pictures of {} x {} as was given, found {} x {}", hints.width, hints.height,
                                camera.width, camera.height));
}

/// What OpenCV's calibration sample writes, or a block of ours.
Camera read_single(const JsonReader& json, std::string name, const OpenCvHints& hints) {
  if (const auto fisheye = json.find("fisheye_model"); fisheye && fisheye->number() != 0)
    throw fisheye->error("expected 0: our cameras have no fisheye lenses; calibrate with OpenCV's usual model");
  Camera camera;
  camera.name = std::move(name);
  read_size(json, hints, camera);
  read_camera_matrix(json.at("camera_matrix"), camera);
  camera.distortion = distortion_in(json.at("distortion_coefficients"));
  if (const auto rotation = json.find("rotation"))
    camera.cam_from_rig = pose_in(*rotation, json.at("translation"), hints.mm_per_unit);
  return camera;
}

bool is_single(const JsonReader& json) { return json.is_object() && json.find("camera_matrix"); }

/// The names of a file's blocks, in the order of its list `cameras`.
std::vector<std::string> names_of_blocks(const JsonReader& document) {
  std::vector<std::string> names;
  if (const auto order = document.find("cameras"); order && order->is_array()) {
    for (const JsonReader& item : order->items()) names.push_back(item.text());
    if (std::set(names.begin(), names.end()).size() != names.size()) throw order->error("expected different names");
    return names;
  }
  for (const std::string& name : document.names())
    if (const auto field = document.find(name); field && is_single(*field)) names.push_back(name);
  return names;
}

/// Our own file of several cameras, each of which has to say where it is.
std::vector<Camera> read_blocks(const JsonReader& document, const OpenCvHints& hints) {
  const auto names = names_of_blocks(document);
  std::vector<Camera> cameras;
  cameras.reserve(names.size());
  for (const std::string& name : names) {
    const JsonReader block = document.at(name);
    if (!is_camera_name(name)) throw block.error("expected a camera's name: not empty, no slash, no leading dot");
    if (names.size() > 1) block.at("rotation");
    cameras.push_back(read_single(block, name, hints));
  }
  return cameras;
}

/// M1 D1 M2 D2 of OpenCV's stereo sample, and where we said it, the first camera's place in the rig.
std::vector<Camera> read_pair(const Documents& documents, const OpenCvHints& hints) {
  const auto having = [&](std::string_view name) {
    return std::ranges::find_if(documents, [&](const JsonReader& json) { return json.find(name).has_value(); });
  };
  const auto sized = having("image_width") == documents.end() ? having("M1") : having("image_width");
  std::vector<Camera> cameras;
  for (const std::string number : {"1", "2"}) {
    Camera camera;
    camera.name = "cam" + number;
    read_size(*sized, hints, camera);
    read_camera_matrix(need(documents, "M" + number, "the camera matrix"), camera);
    camera.distortion = distortion_in(need(documents, "D" + number, "the distortion coefficients"));
    cameras.push_back(std::move(camera));
  }
  if (const auto rotation = find_in(documents, "rotation"))
    cameras[0].cam_from_rig =
        pose_in(*rotation, need(documents, "translation", "where camera 1 is"), hints.mm_per_unit);
  return cameras;
}

std::vector<Camera> read_singles(const Documents& documents, const OpenCvHints& hints) {
  std::vector<Camera> cameras;
  for (const JsonReader& document : documents)
    if (is_single(document)) cameras.push_back(read_single(document, fmt::format("cam{}", cameras.size() + 1), hints));
  return cameras;
}

Error not_understood(const Documents& documents) {
  return bad_input(all_files(documents), "",
                   "expected a calibration of OpenCV: camera_matrix and distortion_coefficients of one camera, or "
                   "M1 D1 M2 D2 and R T of two");
}

std::string matrix_text(const std::string& margin, std::string_view name, const Eigen::MatrixXd& matrix) {
  std::vector<std::string> numbers;
  numbers.reserve(static_cast<std::size_t>(matrix.size()));
  for (Eigen::Index i = 0; i < matrix.size(); ++i)
    numbers.push_back(real_text(matrix(i / matrix.cols(), i % matrix.cols())));
  return fmt::format("{0}{1}: !!opencv-matrix\n{0}   rows: {2}\n{0}   cols: {3}\n{0}   dt: d\n{0}   data: [ {4} ]\n",
                     margin, name, matrix.rows(), matrix.cols(), fmt::join(numbers, ", "));
}

Eigen::Matrix3d camera_matrix(const Camera& camera) {
  return Eigen::Matrix3d{{camera.fx, 0, camera.cx}, {0, camera.fy, camera.cy}, {0, 0, 1}};
}

Eigen::MatrixXd coefficients(const BrownConrady& d) {
  return Eigen::RowVector<double, 5>(d.k1, d.k2, d.p1, d.p2, d.k3);
}

std::string pose_text(const std::string& margin, const Rigid3& cam_from_rig, double mm_per_unit) {
  return matrix_text(margin, "rotation", cam_from_rig.rotation) +
         matrix_text(margin, "translation", cam_from_rig.translation / mm_per_unit);
}

std::string single_text(const std::string& margin, const Camera& camera, double mm_per_unit) {
  return fmt::format("{0}image_width: {1}\n{0}image_height: {2}\n", margin, camera.width, camera.height) +
         matrix_text(margin, "camera_matrix", camera_matrix(camera)) +
         matrix_text(margin, "distortion_coefficients", coefficients(camera.distortion)) +
         pose_text(margin, camera.cam_from_rig, mm_per_unit);
}

/// cv::FileStorage knows no quotes around names; `cameras` is the list of them.
bool is_field_name(std::string_view name) {
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; };
  const auto is_inner = [&](char c) { return is_letter(c) || (c >= '0' && c <= '9') || c == '-'; };
  return !name.empty() && is_letter(name.front()) && name != "cameras" && std::ranges::all_of(name, is_inner);
}

}  // namespace

Rig read_opencv_rig(std::span<const std::filesystem::path> files, const OpenCvHints& hints) {
  Documents documents;
  for (const auto& file : files) {
    documents.push_back(read_yaml(file));
    if (!documents.back().is_object()) throw not_understood({documents.back()});
  }
  Rig rig;
  if (documents.size() == 1) rig.cameras = read_blocks(documents[0], hints);
  if (!rig.cameras.empty()) return rig;
  rig.cameras = find_in(documents, "M1") ? read_pair(documents, hints) : read_singles(documents, hints);
  if (rig.cameras.empty()) throw not_understood(documents);
  if (rig.cameras.size() > 2) throw bad_input(files.back(), "", "expected at most two cameras");
  if (rig.cameras.size() == 2) {
    const std::string_view what = "the place of camera 2, X_camera2 = R X_camera1 + T, as in extrinsics.yml";
    const JsonReader rotation = need(documents, "R", what);
    const Rigid3 second_from_first = pose_in(rotation, need(documents, "T", what), hints.mm_per_unit);
    rig.cameras[1].cam_from_rig = second_from_first * rig.cameras[0].cam_from_rig;
  }
  return rig;
}

void write_opencv_rig(const std::filesystem::path& file, const Rig& rig, double mm_per_unit) {
  if (rig.cameras.size() == 1) {
    write_bytes(file, first_line + single_text("", rig.cameras[0], mm_per_unit));
    return;
  }
  std::vector<std::string> names;
  std::string blocks;
  for (const Camera& camera : rig.cameras) {
    if (!is_field_name(camera.name))
      throw cannot_write(file, fmt::format("\"{}\" cannot be a field of OpenCV's: name the camera with letters, "
                                           "digits, _ and -, a letter first",
                                           camera.name));
    names.push_back(camera.name);
    blocks += camera.name + ":\n" + single_text("   ", camera, mm_per_unit);
  }
  write_bytes(file, fmt::format("{}cameras: [ {} ]\n{}", first_line, fmt::join(names, ", "), blocks));
}

void write_opencv_stereo(const std::filesystem::path& folder, const Rig& rig, double mm_per_unit) {
  if (rig.cameras.size() != 2)
    throw cannot_write(folder, fmt::format("OpenCV's stereo files hold two cameras, and the rig has {}: the format "
                                           "opencv holds any number",
                                           rig.cameras.size()));
  const Camera &first = rig.cameras[0], &second = rig.cameras[1];
  if (first.width != second.width || first.height != second.height)
    throw cannot_write(folder,
                       "OpenCV's stereo files hold cameras of one size, and the rig's differ: the format "
                       "opencv holds any");
  std::string intrinsics = first_line;
  intrinsics += fmt::format("image_width: {}\nimage_height: {}\n", first.width, first.height);
  for (const auto& [number, camera] : {std::pair("1", &first), std::pair("2", &second)}) {
    intrinsics += matrix_text("", fmt::format("M{}", number), camera_matrix(*camera));
    intrinsics += matrix_text("", fmt::format("D{}", number), coefficients(camera->distortion));
  }
  const Rigid3 second_from_first = second.cam_from_rig * first.cam_from_rig.inverse();
  const std::string extrinsics = first_line + matrix_text("", "R", second_from_first.rotation) +
                                 matrix_text("", "T", second_from_first.translation / mm_per_unit) +
                                 pose_text("", first.cam_from_rig, mm_per_unit);
  const NamedText files[] = {{"intrinsics.yml", intrinsics}, {"extrinsics.yml", extrinsics}};
  write_together(folder, files);
}

}  // namespace pagesweep
