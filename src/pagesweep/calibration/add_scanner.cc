// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "pagesweep/base/error.h"
#include "pagesweep/calibration/calibration_steps_internal.h"

namespace pagesweep {
namespace {

constexpr int folds = 5;
constexpr std::size_t fewest_poses = 3;
/// A richer or unusual model must predict better by this much to be preferred over one that comes earlier in the list.
constexpr double worthwhile = 0.98;

/// The scanner's pictures beside boards whose poses are known: all that its start values and trials need.
struct ScannerData {
  Bundle bundle;  ///< boards' poses are held, the only sensor is the scanner
  std::vector<int> poses;
  int width = 0, height = 0;
};

ScannerData data_of(const SensorPictures& pictures, const Bundle& cameras) {
  ScannerData data{cameras, {}, pictures.width, pictures.height};
  data.bundle.sensors.assign(1, Sensor{scanner_name, {}, 1, false, false});
  data.bundle.pose_is_held.assign(cameras.rig_from_board.size(), true);
  data.bundle.observations.clear();
  for (const BoardPicture& picture : pictures.pictures) {
    const auto is_known = std::ranges::any_of(
        cameras.observations, [&](const Observation& seen) { return seen.pose == picture.pose && seen.used; });
    if (!is_known || picture.view.corners.empty()) continue;
    data.poses.push_back(picture.pose);
    for (const BoardCorner& corner : picture.view.corners)
      data.bundle.observations.push_back({0, picture.pose, corner.number, corner.pixel});
  }
  return data;
}

ScanPoints points_of(const ScannerData& data) {
  ScanPoints points{data.width, data.height, {}, {}};
  for (const Observation& seen : data.bundle.observations) {
    if (!seen.used) continue;
    points.rig_mm.push_back(data.bundle.rig_from_board[std::size_t(seen.pose)] *
                            data.bundle.shape.corner_mm(data.bundle.board, seen.corner));
    points.pixels.push_back(seen.pixel);
  }
  return points;
}

/// Fits a model to the observations in use; false if it cannot be.
bool fit(ScannerData& data, ScannerModel model) {
  const auto start = find_scanner(model, points_of(data));
  if (!start) return false;
  data.bundle.sensors.front().model = *start;
  try {
    // The closed forms are exact but for distortion and noise, so an error of some pixels is an outlier.
    solve(data.bundle, {LensModel::k1, false, false, 5.0, false});
    solve(data.bundle, {LensModel::k1_k2_tangential, false, false, 3.0, false});
  } catch (const Error&) {
    return false;
  }
  return true;
}

double median_length(const Bundle& bundle, const std::vector<bool>& wanted) {
  std::vector<double> lengths;
  for (std::size_t k = 0; k < wanted.size(); ++k)
    if (wanted[k]) lengths.push_back(bundle.residual(bundle.observations[k]).norm());
  for (double& length : lengths)
    if (!std::isfinite(length)) length = std::numeric_limits<double>::max();
  if (lengths.empty()) return 0;
  const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  return *middle;
}

/// Rms of what a model predicts for poses that it was not fitted to, beyond the reach of single misread corners.
double predict_left_out(const ScannerData& all, ScannerModel model) {
  double squares = 0;
  int count = 0;
  for (int fold = 0; fold < folds; ++fold) {
    ScannerData data = all;
    std::vector<bool> left_out;
    for (Observation& seen : data.bundle.observations) {
      const auto place = std::ranges::find(all.poses, seen.pose) - all.poses.begin();
      seen.used = place % folds != fold;
      left_out.push_back(!seen.used);
    }
    if (!fit(data, model)) return std::numeric_limits<double>::quiet_NaN();
    const double most = 5 * median_length(data.bundle, left_out);
    for (std::size_t k = 0; k < left_out.size(); ++k) {
      if (!left_out[k]) continue;
      const double length = data.bundle.residual(data.bundle.observations[k]).norm();
      if (!(length <= most)) continue;
      squares += length * length;
      ++count;
    }
  }
  return count > 0 ? std::sqrt(squares / count) : std::numeric_limits<double>::quiet_NaN();
}

ScannerModel choose(const ScannerData& data, std::vector<ScannerTrial>& trials) {
  ScannerTrial* best = nullptr;
  trials.clear();
  for (const ScannerModel model : {ScannerModel::pushbroom, ScannerModel::rotating_line, ScannerModel::brown_conrady})
    trials.push_back({model, predict_left_out(data, model), false});
  for (ScannerTrial& trial : trials)
    if (std::isfinite(trial.rms_px) && (!best || trial.rms_px < worthwhile * best->rms_px)) best = &trial;
  if (!best)
    throw no_result("no model of the scanner fits its pictures: show the board at other heights and tilts as well");
  best->chosen = true;
  return best->model;
}

std::optional<ScannerModel> model_wanted(ScannerModelChoice choice) {
  if (choice == ScannerModelChoice::auto_) return std::nullopt;
  return static_cast<ScannerModel>(static_cast<int>(choice) - 1);
}

void require_sound(const ScannerData& data) {
  if (data.poses.size() < fewest_poses)
    throw Error(
        ErrorKind::bad_input,
        fmt::format("the scanner and the cameras see the board together in {} poses, and at least {} are needed",
                    data.poses.size(), fewest_poses));
  if (is_mirrored(points_of(data)))
    throw Error(ErrorKind::bad_input, "the scanner's pictures are mirrored: switch off what flips them");
}

}  // namespace

void add_scanner(const CalibrationInput& input, const CalibrationOptions& options, Bundle& bundle,
                 std::vector<ScannerTrial>& trials, std::vector<std::string>& warnings) {
  const SensorPictures& pictures = input.sensors.back();
  ScannerData data = data_of(pictures, bundle);
  require_sound(data);
  const auto wanted = model_wanted(options.scanner_model);
  const ScannerModel model = wanted ? *wanted : choose(data, trials);
  if (!fit(data, model))
    throw no_result(
        fmt::format("the scanner's pictures do not determine it as {}: show the board at other heights and "
                    "tilts as well",
                    name_of(model)));
  if (data.poses.size() < pictures.pictures.size())
    warnings.push_back(fmt::format("{} of {} pictures of the scanner show a pose that the cameras see too",
                                   data.poses.size(), pictures.pictures.size()));
  const int sensor = static_cast<int>(bundle.sensors.size());
  bundle.sensors.push_back({scanner_name, data.bundle.sensors.front().model, 1, false, false});
  for (Observation seen : data.bundle.observations) {
    seen.sensor = sensor;
    bundle.observations.push_back(seen);
  }
}

}  // namespace pagesweep
