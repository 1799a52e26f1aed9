// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/evaluate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pagesweep/base/error.h"
#include "pagesweep/evaluation/time_bound.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/capture_file.h"
#include "pagesweep/io/float_tiff.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/ply_file.h"
#include "pagesweep/io/result_files.h"
#include "pagesweep/io/rig_file.h"
#include "pagesweep/io/truth_file.h"
#include "pagesweep/ocr/recognise_text.h"

namespace pagesweep {
namespace {

namespace fs = std::filesystem;

/// One camera's part of truth and result.
struct CameraData {
  const Camera* camera;
  TruePoints truth;
  std::optional<PointMap> points;
  std::optional<TimeMap> times;
};

fs::path folder_of(const fs::path& folder_or_file) {
  const fs::path folder = fs::is_directory(folder_or_file) ? folder_or_file : folder_or_file.parent_path();
  return (folder.empty() ? fs::path(".") : folder).lexically_normal();
}

std::optional<Capture> capture_beside(const fs::path& truth) {
  const fs::path folder = fs::absolute(folder_of(truth) / "..").lexically_normal();
  if (!fs::exists(folder / "capture.json")) return std::nullopt;
  return read_capture(folder);
}

Rig find_rig(const EvaluationOptions& options, const std::optional<Capture>& capture, const fs::path& truth) {
  if (!options.rig.empty()) return read_rig(options.rig);
  if (capture) return read_capture_rig(*capture);
  throw bad_input(truth, "", "there is no capture.json in the folder above it that names the rig; give a rig file");
}

std::vector<CameraData> read_cameras(const fs::path& out, const Truth& truth, const Rig& rig) {
  std::vector<CameraData> cameras;
  for (const Camera& camera : rig.cameras) {
    if (!fs::exists(truth.camera_points_path(camera.name))) continue;
    const CameraFiles files(out, camera.name);
    CameraData data{&camera, read_camera_points(truth, camera.name), read_point_map(files, camera),
                    read_time_map(files, camera)};
    if (data.truth.width() != camera.width || data.truth.height() != camera.height)
      throw bad_input(truth.camera_points_path(camera.name), "", "its size is not the camera's in the rig");
    cameras.push_back(std::move(data));
  }
  return cameras;
}

/// The perpendicular errors of the page pixels that were clipped in some frame.
std::optional<ErrorSummary> summarise_clipped(const fs::path& out, const std::vector<CameraData>& cameras,
                                              const std::vector<Image<float>>& error_maps) {
  std::vector<double> errors;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const Camera& camera = *cameras[c].camera;
    const fs::path file = CameraFiles(out, camera.name).clipped;
    if (!fs::exists(file)) return std::nullopt;
    const GrayImage counts = read_gray(file, ImageSize{camera.width, camera.height});
    std::visit(
        [&](const auto& frames) {
          for (std::size_t i = 0; i < frames.size(); ++i)
            if (const float error = error_maps[c].data()[i]; frames.data()[i] > 0 && std::isfinite(error))
              errors.push_back(error);
        },
        counts);
  }
  return summarise(std::move(errors));
}

void evaluate_points(const fs::path& out, const std::vector<CameraData>& cameras, const EvaluationOptions& options,
                     Evaluation& evaluation) {
  std::vector<MeasuredView> views;
  for (const CameraData& data : cameras)
    views.push_back({data.camera, data.points ? &*data.points : nullptr, &data.truth});
  const bool have_maps = std::all_of(views.begin(), views.end(), [](const MeasuredView& view) { return view.points; });
  if (views.empty()) {
    evaluation.points_reason = "the truth has the points of no camera of the rig";
  } else if (have_maps) {
    evaluation.points = compare_points(views, options.points);
    evaluation.clipped_points = summarise_clipped(out, cameras, evaluation.points->error_maps);
  } else if (fs::exists(out / "points.ply")) {
    const PointCloud cloud = read_ply(out / "points.ply");
    evaluation.points_from_cloud = true;
    evaluation.points = PointComparison{{}, compare_cloud(cloud.points, cloud.sigma, views), {}};
  } else {
    evaluation.points_reason = "the result has neither point maps of all cameras nor points.ply";
  }
}

/// The bound, if the truth tells profile and sensor.
BoundOfAmplitude find_bound(const Truth& truth, const std::optional<Capture>& capture) {
  if (!truth.sensor || !truth.profile || !(truth.sensor->gain_e_per_gray > 0) || truth.profile->values.size() < 3)
    return {};
  if (!capture || capture->sequences.empty())
    return TimeBound(*truth.profile, *truth.sensor, std::numeric_limits<double>::infinity());
  const SequenceFiles& files = capture->sequences[0];
  return TimeBound(*truth.profile, *truth.sensor, files.saturation - files.black_level,
                   relative_exposures(files.exposure_ms, files.count));
}

void evaluate_times(const std::vector<CameraData>& cameras, const Rig& rig, const BoundOfAmplitude& bound,
                    const EvaluationOptions& options, Evaluation& evaluation) {
  std::vector<TimedView> views;
  for (const CameraData& data : cameras)
    if (data.times) views.push_back({&*data.times, &data.truth});
  if (!rig.light)
    evaluation.times_reason = "the rig has no model of the light";
  else if (views.empty())
    evaluation.times_reason = "the result has no time maps";
  else
    evaluation.times = compare_times(views, *rig.light, options.times, bound);
}

/// Places on the line where two neighbouring pages meet: of their borders, the two that are nearest to each other.
std::vector<Eigen::Vector3f> find_gutter(const Truth& truth) {
  constexpr int places = 80;
  constexpr float farthest_mm = 30;
  const auto border = [](const Image<Eigen::Vector3f>& points, int column) {
    std::vector<Eigen::Vector3f> line;
    for (int k = 0; k < places; ++k) line.push_back(points(column, k * (points.height() - 1) / (places - 1)));
    return line;
  };
  std::vector<Eigen::Vector3f> gutter;
  for (std::size_t p = 0; p + 1 < truth.pages.size(); ++p) {
    const auto left = read_page_points(truth, truth.pages[p].index),
               right = read_page_points(truth, truth.pages[p + 1].index);
    const auto one = border(left, left.width() - 1), other = border(right, 0);
    for (std::size_t k = 0; k < one.size(); ++k)
      if ((one[k] - other[k]).norm() < farthest_mm) gutter.push_back(0.5f * (one[k] + other[k]));
  }
  return gutter;
}

void evaluate_kinds(const Truth& truth, const std::vector<CameraData>& cameras, const BoundOfAmplitude& bound,
                    const EvaluationOptions& options, Evaluation& evaluation) {
  std::vector<KindView> views;
  for (std::size_t c = 0; c < cameras.size(); ++c)
    if (cameras[c].points && cameras[c].times && evaluation.points && c < evaluation.points->error_maps.size())
      views.push_back({cameras[c].camera, &*cameras[c].points, &*cameras[c].times, &cameras[c].truth,
                       &evaluation.points->error_maps[c]});
  if (!views.empty()) evaluation.kinds = compare_kinds(views, find_gutter(truth), options.times, bound);
}

/// The page's picture, whatever its format; one without samples if there is none.
Picture read_result(const PageFiles& files) {
  const auto pictures = files.pictures();
  return pictures.empty() ? Picture{} : read_picture(pictures.front());
}

void evaluate_text(const Picture& result, const Picture& printed, const Truth& truth, const TruthPage& page,
                   const TextRecogniser& read_text, PageEvaluation& evaluation) {
  constexpr std::size_t most_bytes = 16 << 20;
  if (page.text.empty()) {
    evaluation.text_reason = "the truth does not tell the printed text";
    return;
  }
  const std::string text = read_bytes(truth.folder / page.text, most_bytes);
  evaluation.text = TextEvaluation{compare_text(text, plain_text(read_text(result))),
                                   compare_text(text, plain_text(read_text(printed)))};
}

void evaluate_look(const Picture& result, const Truth& truth, const TruthPage& page,
                   const std::optional<TextRecogniser>& read_text, PageEvaluation& evaluation) {
  if (!fs::exists(truth.page_path(page.index))) {
    evaluation.text_reason = "the truth has no picture of this page";
    return;
  }
  Picture printed = read_picture(truth.page_path(page.index));
  printed.pixels_per_mm = page.pixels_per_mm;
  evaluation.picture = compare_pictures(result, printed, *evaluation.errors);
  evaluation.text_reason = "no language was given";
  if (read_text) evaluate_text(result, printed, truth, page, *read_text, evaluation);
}

PageEvaluation evaluate_page(const fs::path& out, const Truth& truth, const TruthPage& page,
                             const std::optional<TextRecogniser>& read_text, const EvaluationOptions& options) {
  PageEvaluation evaluation{page.index, {}, {}, {}, {}, "this page could not be compared"};
  const PageFiles files(out, page.index);
  const Picture picture = read_result(files);
  const double pixels_per_mm = picture.pixels_per_mm;
  if (!fs::exists(files.scan_map)) {
    evaluation.reason = "the result does not have this page";
  } else if (!(pixels_per_mm > 0)) {
    evaluation.reason = "there is no picture of this page that states its resolution";
  } else if (!fs::exists(truth.page_scan_map_path(page.index))) {
    evaluation.reason = "the truth has no scan map of this page";
  } else {
    const ScanMap result_map = read_scan_map(files.scan_map);
    const ScanMap true_map = read_page_scan_map(truth, page.index);
    evaluation.errors = compare_pages({&result_map, pixels_per_mm}, {&true_map, page.pixels_per_mm}, options.pages);
    if (evaluation.errors->displacement.count == 0) {
      evaluation.errors.reset();
      evaluation.reason = "the result shows nothing of this page";
    } else {
      evaluate_look(picture, truth, page, read_text, evaluation);
    }
  }
  return evaluation;
}

}  // namespace

Evaluation evaluate(const fs::path& out, const fs::path& truth_folder, const EvaluationOptions& options,
                    Progress& progress) {
  if (!fs::is_directory(out)) throw cannot_read(out, "there is no such folder");
  const Truth truth = read_truth(truth_folder);
  const std::optional<Capture> capture = capture_beside(truth_folder);
  const Rig rig = find_rig(options, capture, truth_folder);
  Evaluation evaluation;
  progress.begin("reading points and times");
  const std::vector<CameraData> cameras = read_cameras(out, truth, rig);
  for (const CameraData& data : cameras) evaluation.cameras.push_back(data.camera->name);
  progress.begin("points against the true surface");
  evaluate_points(out, cameras, options, evaluation);
  progress.begin("time values against the light's middle");
  const BoundOfAmplitude bound = find_bound(truth, capture);
  evaluate_times(cameras, rig, bound, options, evaluation);
  evaluate_kinds(truth, cameras, bound, options, evaluation);
  progress.begin("pages against the printed ones");
  std::optional<TextRecogniser> read_text;
  if (!options.ocr.empty()) read_text.emplace(options.ocr);
  for (const TruthPage& page : truth.pages) {
    evaluation.pages.push_back(evaluate_page(out, truth, page, read_text, options));
    progress.advance(static_cast<double>(evaluation.pages.size()) / static_cast<double>(truth.pages.size()));
  }
  for (const int index : pages_in(out))
    if (std::none_of(truth.pages.begin(), truth.pages.end(), [&](const TruthPage& p) { return p.index == index; }))
      evaluation.unexpected_pages.push_back(index);
  return evaluation;
}

}  // namespace pagesweep
