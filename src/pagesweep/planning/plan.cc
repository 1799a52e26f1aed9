// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/planning/plan.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <stdexcept>
#include <tuple>

#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

constexpr int most_cells = 4'000'000;  // of a height: what is more is a mistake
constexpr double coarse_grid = 24;     // cells along the longer side, for variations

void require(bool holds, const std::string& problem) {
  if (!holds) throw std::invalid_argument(problem);
}

void require_sound(const PlanRequest& request) {
  require(!request.cameras.empty() && request.cameras.size() <= 2,
          fmt::format("a plan is for one or two cameras, and there are {}", request.cameras.size()));
  const TableExtent& table = request.table;
  require(table.width_mm > 0 && table.depth_mm > 0, "--page: expected sides above 0");
  require(!request.heights_mm.empty(), "--height-mm: expected at least one height");
  require(request.grid_mm > 0, "--grid-mm: expected a distance above 0");
  require((table.width_mm / request.grid_mm + 1) * (table.depth_mm / request.grid_mm + 1) < most_cells,
          "--grid-mm: expected a coarser grid for a table of this size");
}

Eigen::Vector3d middle_of(const TableExtent& table) { return {table.center_x_mm, table.center_y_mm, 0}; }

/// Adds squares; missing values stay out.
struct MeanSquare {
  double sum = 0;
  int count = 0;
  void add(double value) {
    if (!std::isfinite(value)) return;
    sum += value * value;
    ++count;
  }
  double root() const { return count > 0 ? std::sqrt(sum / count) : SpotAccuracy::missing; }
};

constexpr double SpotAccuracy::* fields[] = {&SpotAccuracy::match_px, &SpotAccuracy::stereo_mm, &SpotAccuracy::joint_mm,
                                             &SpotAccuracy::section_mm, &SpotAccuracy::height_share};

/// Root mean squares over the cameras; a section by the one that does it better.
SpotAccuracy plan_spot(const PlanRequest& request, double time_sigma, const Eigen::Vector3d& spot) {
  MeanSquare means[std::size(fields)];
  double best_section = SpotAccuracy::missing;
  for (const Camera& camera : request.cameras) {
    const Camera* other = request.cameras.size() < 2          ? nullptr
                          : &camera == request.cameras.data() ? &request.cameras.back()
                                                              : &request.cameras.front();
    const SpotAccuracy accuracy = plan_point(camera, other, request.light, time_sigma, spot);
    for (std::size_t f = 0; f < std::size(fields); ++f) means[f].add(accuracy.*fields[f]);
    best_section = std::fmin(best_section, accuracy.section_mm);  // of a missing and a finite value, the finite one
  }
  SpotAccuracy mean;
  for (std::size_t f = 0; f < std::size(fields); ++f) mean.*fields[f] = means[f].root();
  mean.section_mm = best_section;
  return mean;
}

HeightPlan plan_height(const PlanRequest& request, double time_sigma, double height_mm) {
  const TableExtent& table = request.table;
  const auto cells = [&](double side_mm) {
    return std::max(1, static_cast<int>(std::lround(side_mm / request.grid_mm)));
  };
  HeightPlan plan;
  plan.height_mm = height_mm;
  plan.cameras = Image<std::uint8_t>(cells(table.width_mm), cells(table.depth_mm));
  plan.spots = Image<SpotAccuracy>(plan.cameras.width(), plan.cameras.height(), SpotAccuracy{});
  parallel_rows(plan.spots.height(), [&](int row) {
    for (int column = 0; column < plan.spots.width(); ++column) {
      const double x = ((column + 0.5) / plan.spots.width() - 0.5) * table.width_mm;
      const double y = (0.5 - (row + 0.5) / plan.spots.height()) * table.depth_mm;
      const Eigen::Vector3d spot = middle_of(table) + Eigen::Vector3d(x, y, height_mm);
      for (const Camera& camera : request.cameras) plan.cameras(column, row) += sees_level(camera, spot) ? 1 : 0;
      plan.spots(column, row) = plan_spot(request, time_sigma, spot);
    }
  });
  return plan;
}

/// A plan without variations.
Plan plan_only(const PlanRequest& request) {
  require_sound(request);
  Plan plan;
  plan.request = request;
  const double own_speed = speed_on_table(request.light, middle_of(request.table));
  if (!(own_speed > 0)) throw no_result("the sheet of light never passes the middle of the table");
  plan.mm_per_frame = request.mm_per_frame != 0 ? request.mm_per_frame : own_speed;
  plan.stripe_frames = request.recording.stripe_mm / plan.mm_per_frame;
  plan.time = plan_time(request.recording, plan.mm_per_frame);
  // In a frame a faster light gets farther: its times, counted in frames of the rig's own light, are less certain.
  const double own_time_sigma = plan.time_sigma() * plan.mm_per_frame / own_speed;
  if (request.cameras.size() == 2)
    plan.baseline_mm = (request.cameras[1].center() - request.cameras[0].center()).norm();
  for (const double height : request.heights_mm) plan.heights.push_back(plan_height(request, own_time_sigma, height));
  return plan;
}

double median_height_error(const PlanRequest& request) {
  PlanRequest coarse = request;
  coarse.grid_mm = std::max(request.grid_mm, std::max(request.table.width_mm, request.table.depth_mm) / coarse_grid);
  const Plan plan = plan_only(coarse);
  if (!std::isfinite(plan.time.total())) return std::numeric_limits<double>::infinity();
  return spread_of(plan.heights, plan.method(), true).median;
}

/// Each thing that can be chosen, at half and at twice its value (the gray depth two bits up and down).
std::vector<Variation> vary(const PlanRequest& request, double mm_per_frame) {
  const double now = median_height_error(request);
  std::vector<Variation> variations;
  const auto add = [&](const std::string& name, const std::string& what, const auto& change) {
    PlanRequest varied = request;
    change(varied);
    variations.push_back({name, what, median_height_error(varied) / now});
  };
  const RecordingPlan& plan = request.recording;
  for (const double factor : {0.5, 2.0}) {
    const std::string size = factor < 1 ? "_half" : "_double";
    add("stripe" + size, fmt::format("stripe {:.3g} mm wide, as bright", factor * plan.stripe_mm),
        [&](PlanRequest& varied) { varied.recording.stripe_mm *= factor; });
    add("speed" + size, fmt::format("{:.3g} mm a frame", factor * mm_per_frame),
        [&](PlanRequest& varied) { varied.mm_per_frame = factor * mm_per_frame; });
    add("light" + size,
        fmt::format("{} the light{}", factor < 1 ? "half" : "twice", factor * plan.amplitude > 1 ? ", clipped" : ""),
        [&](PlanRequest& varied) { varied.recording.amplitude *= factor; });
    if (request.cameras.size() == 2)
      add("baseline" + size, fmt::format("cameras {} as far apart", factor < 1 ? "half" : "twice"),
          [&](PlanRequest& varied) { varied.cameras = spread_cameras(varied.cameras, factor); });
    add("full_well" + size, fmt::format("full well of {:.5g} electrons", factor * plan.full_well_electrons),
        [&](PlanRequest& varied) { varied.recording.full_well_electrons *= factor; });
    if (plan.read_noise_electrons > 0)
      add("read_noise" + size, fmt::format("read noise of {:.3g} electrons", factor * plan.read_noise_electrons),
          [&](PlanRequest& varied) { varied.recording.read_noise_electrons *= factor; });
    if (const int bits = plan.bits + (factor < 1 ? -2 : 2); bits >= 1 && bits <= 16)
      add(factor < 1 ? "bits_less" : "bits_more", fmt::format("{} bit", bits),
          [&](PlanRequest& varied) { varied.recording.bits = bits; });
  }
  return variations;
}

}  // namespace

std::optional<TableExtent> extent_named(std::string_view text) {
  // Long and short side of ISO 216 paper.
  for (const auto& [name, width, depth] :
       {std::tuple{"A2", 594, 420}, {"A3", 420, 297}, {"A4", 297, 210}, {"A5", 210, 148}})
    if (text == name) return TableExtent{double(width), double(depth), 0, 0};
  TableExtent extent;
  const std::string line(text);
  int size_end = 0, end = 0;
  const int numbers = std::sscanf(line.c_str(), "%lfx%lf%n%lf%lf%n", &extent.width_mm, &extent.depth_mm, &size_end,
                                  &extent.center_x_mm, &extent.center_y_mm, &end);
  const int length = static_cast<int>(line.size());
  const bool is_whole = (numbers == 2 && size_end == length) || (numbers == 4 && end == length);
  const double farthest = 1e6;
  const bool is_sound = extent.width_mm > 0 && extent.depth_mm > 0 && extent.width_mm < farthest &&
                        extent.depth_mm < farthest && std::abs(extent.center_x_mm) < farthest &&
                        std::abs(extent.center_y_mm) < farthest;
  return is_whole && is_sound ? std::optional(extent) : std::nullopt;
}

Light upright_light() { return Light(TranslatingPlane{Eigen::Vector3d::UnitY(), 0, 1}); }

double speed_on_table(const Light& light, const Eigen::Vector3d& place) {
  const Eigen::Vector2d slope(time_slope(light, place, Eigen::Vector3d::UnitX()),
                              time_slope(light, place, Eigen::Vector3d::UnitY()));
  return 1 / slope.norm();
}

Image<float> HeightPlan::map_of(double SpotAccuracy::* field) const {
  Image<float> map(spots.width(), spots.height());
  for (std::size_t i = 0; i < map.size(); ++i) map.data()[i] = static_cast<float>(spots.data()[i].*field);
  return map;
}

Image<float> HeightPlan::height_map_of(double SpotAccuracy::* field) const {
  Image<float> map = map_of(field);
  for (std::size_t i = 0; i < map.size(); ++i) map.data()[i] *= static_cast<float>(spots.data()[i].height_share);
  return map;
}

double HeightPlan::share_seen_by(int count) const {
  const auto seen = std::count(cameras.pixels().begin(), cameras.pixels().end(), static_cast<std::uint8_t>(count));
  return static_cast<double>(seen) / static_cast<double>(cameras.size());
}

double Plan::time_sigma() const { return std::sqrt(time.total()); }

double SpotAccuracy::* Plan::method() const {
  return request.cameras.size() == 2 ? &SpotAccuracy::stereo_mm : &SpotAccuracy::section_mm;
}

Spread spread_of(const std::vector<HeightPlan>& heights, double SpotAccuracy::* field, bool as_height) {
  std::vector<float> values;
  for (const HeightPlan& plan : heights) {
    const Image<float> map = as_height ? plan.height_map_of(field) : plan.map_of(field);
    std::copy_if(map.pixels().begin(), map.pixels().end(), std::back_inserter(values),
                 [](float value) { return std::isfinite(value); });
  }
  if (values.empty()) return {};
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  const double median = *middle;
  return {median, *std::max_element(values.begin(), values.end())};
}

std::vector<Camera> spread_cameras(const std::vector<Camera>& cameras, double factor) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Camera& camera : cameras) middle += camera.center() / static_cast<double>(cameras.size());
  std::vector<Camera> spread = cameras;
  for (Camera& camera : spread) {
    const Eigen::Vector3d center = camera.center(), moved = middle + factor * (center - middle);
    const Eigen::Vector3d axis = camera.cam_from_rig.rotation.row(2).transpose();
    const auto target = Plane{Eigen::Vector3d::UnitZ(), 0}.meet({center, axis});
    const Eigen::Vector3d moved_axis = target ? *target - moved : axis;
    const Eigen::Matrix3d turn = Eigen::Quaterniond::FromTwoVectors(axis, moved_axis).toRotationMatrix();
    camera.cam_from_rig.rotation = camera.cam_from_rig.rotation * turn.transpose();
    camera.cam_from_rig.translation = -(camera.cam_from_rig.rotation * moved);
  }
  return spread;
}

Plan make_plan(const PlanRequest& request) {
  Plan plan = plan_only(request);
  if (!std::isfinite(plan.time.total()))
    throw no_result(
        "such a recording does not tell when the stripe passes: it falls between the frames, drowns in noise, or is "
        "clipped");
  if (!std::isfinite(spread_of(plan.heights, plan.method(), false).median))
    throw no_result(
        "the cameras do not see this part of the table together: is z = 0 of the rig the table, and its middle at x = "
        "0, "
        "y = 0? --page 420x297+X+Y puts it elsewhere");
  plan.variations = vary(request, plan.mm_per_frame);
  plan.best_stripe_mm = best_stripe_mm(request.recording, plan.mm_per_frame);
  RecordingPlan best = request.recording;
  best.stripe_mm = plan.best_stripe_mm;
  plan.best_stripe_ratio = std::sqrt(plan_time(best, plan.mm_per_frame).total() / plan.time.total());
  return plan;
}

}  // namespace pagesweep
