// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/lamp_light.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "pagesweep/base/median.h"
#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

constexpr double least_light = 1e-3;
constexpr double tolerance = 0.02;     // by which the light of blank paper scatters, relative
constexpr double least_relief_mm = 6;  // of heights, to tell how far the lamp is away
constexpr double least_gain = 0.1;     // of the cost
constexpr std::size_t least_samples = 100;

Plane sheet_at(const ScanLight& light, const Eigen::Vector3d& point) {
  if (light.sheet)
    if (const auto time = light.sheet->time_of(point)) return light.sheet->plane_at(*time);
  return {};
}

/// Integrals over the bar, x' from a to b: of 1 / (D^2 + x'^2)^2, and of x' / (D^2 + x'^2)^2.
std::pair<double, double> bar_integrals(double distance, double a, double b) {
  const double d2 = distance * distance;
  const auto even = [&](double x) {
    return x / (2 * d2 * (d2 + x * x)) + std::atan(x / distance) / (2 * d2 * distance);
  };
  const auto odd = [&](double x) { return -1 / (2 * (d2 + x * x)); };
  return {even(b) - even(a), odd(b) - odd(a)};
}

/// A spot of paper in the light, without the lamp: what does not change while lamps are tried.
struct PlacedSpot {
  double towards_up, towards_along;  // of its normal
  double height_mm, along_mm, rise;  // rise: of the direction up

  PlacedSpot(const LightFrame& frame, const Eigen::Vector3d& point, const Eigen::Vector3d& normal)
      : towards_up(normal.dot(frame.up)),
        towards_along(normal.dot(frame.along)),
        height_mm(point.z()),
        along_mm(point.dot(frame.along)),
        rise(frame.up.z()) {}

  double irradiance(const LampBar& bar) const {
    const double distance = std::max(10.0, (bar.height_mm - height_mm) / rise);
    const double middle = bar.center_mm - along_mm;
    const auto [even, odd] = bar_integrals(distance, middle - 0.5 * bar.length_mm, middle + 0.5 * bar.length_mm);
    return std::max(least_light * even, towards_up * even + towards_along * odd / distance) * distance * distance;
  }
};

struct PlacedSample {
  PlacedSpot spot, reference;
};

/// Irradiance of each sample relative to the reference. Without a bar, light comes from afar.
std::vector<double> light_on(std::span<const PlacedSample> places, const std::optional<LampBar>& bar) {
  std::vector<double> direct;
  for (const auto& [spot, reference] : places)
    direct.push_back(bar ? spot.irradiance(*bar) / reference.irradiance(*bar) : spot.towards_up / reference.towards_up);
  return direct;
}

/// How uneven blank paper is after the light is divided out: 0 not at all, 1 altogether. Each sheet's own brightness is
/// free.
/// \param samples  sheet by sheet
double unevenness(std::span<const double> direct, double ambient, std::span<const PaperSample> samples) {
  std::vector<double> logs(samples.size());
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const double light = ambient + (1 - ambient) * std::max(direct[k] + samples[k].glow, least_light);
    logs[k] = std::log(samples[k].light / light);
  }
  double cost = 0;
  for (std::size_t begin = 0, end = 0; begin < samples.size(); begin = end) {
    while (end < samples.size() && samples[end].sheet == samples[begin].sheet) ++end;
    const std::span<const double> sheet = std::span(logs).subspan(begin, end - begin);
    const double level = median({sheet.begin(), sheet.end()});
    for (const double log : sheet) {
      const double off = std::pow((log - level) / tolerance, 2);
      cost += off / (1 + off);
    }
  }
  return cost / static_cast<double>(samples.size());
}

/// A light that is tried.
struct Trial {
  std::optional<LampBar> lamp;
  double ambient = 0, cost = 1;
};

/// The best share of ambient light with this lamp.
Trial try_ambient(const std::optional<LampBar>& lamp, const std::optional<double>& ambient,
                  std::span<const PlacedSample> places, std::span<const PaperSample> samples) {
  constexpr std::array shares{0., 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.};
  const std::vector<double> direct = light_on(places, lamp);
  if (ambient) return {lamp, *ambient, unevenness(direct, *ambient, samples)};
  Trial best{lamp};
  for (const double share : shares)
    if (const double cost = unevenness(direct, share, samples); cost < best.cost) best = {lamp, share, cost};
  return best;
}

bool has_relief(std::span<const PaperSample> samples) {
  std::vector<double> heights;
  for (const PaperSample& sample : samples) heights.push_back(sample.point_mm.z());
  std::ranges::sort(heights);
  const auto at = [&](double share) { return heights[static_cast<std::size_t>(share * double(heights.size() - 1))]; };
  return at(0.95) - at(0.05) > least_relief_mm;
}

}  // namespace

LightFrame LampLight::frame_at(const Eigen::Vector3d& point_mm) const {
  LightFrame frame;
  frame.normal = sheet_at(*light_, point_mm).normal;
  frame.along = frame.normal.cross(Eigen::Vector3d::UnitZ()).normalized();
  frame.up = frame.along.cross(frame.normal).normalized();
  if (frame.up.z() < 0) frame.up = -frame.up;
  return frame;
}

double LampLight::irradiance(const Eigen::Vector3d& point, const Eigen::Vector3d& normal) const {
  const PlacedSpot spot(frame_at(point), point, normal);
  return light_->lamp ? spot.irradiance(*light_->lamp) : std::max(least_light, spot.towards_up);
}

double LampLight::at(const Eigen::Vector3d& point_mm, const Eigen::Vector3d& normal,
                     const Eigen::Vector3d& at_reference_mm) const {
  const double ambient = light_->ambient.value_or(0);
  return ambient + (1 - ambient) * irradiance(point_mm, normal) / irradiance(at_reference_mm, Eigen::Vector3d::UnitZ());
}

ScanLight find_light(ScanLight light, std::span<const PaperSample> samples) {
  const std::optional<double> known_ambient = light.ambient;
  light.ambient = known_ambient.value_or(0);
  if (samples.size() < least_samples || (light.lamp && known_ambient)) return light;
  constexpr std::array heights{200., 250., 300., 350., 400., 450., 500., 600., 700., 850., 1000., 1300., 2000., 4000.};
  constexpr std::array lengths{50., 200., 300., 400., 500., 600., 800., 1200.};
  const LampLight from_afar(light);
  std::vector<PlacedSample> places;
  for (const PaperSample& sample : samples)
    places.push_back({{from_afar.frame_at(sample.point_mm), sample.point_mm, sample.normal},
                      {from_afar.frame_at(sample.at_reference_mm), sample.at_reference_mm, Eigen::Vector3d::UnitZ()}});

  std::vector<Trial> trials{{light.lamp}};
  if (!light.lamp && has_relief(samples))
    for (const double height : heights)
      for (const double length : lengths) trials.push_back({LampBar{height, length, 0}});
  parallel_rows(static_cast<int>(trials.size()), [&](int k) {
    Trial& trial = trials[static_cast<std::size_t>(k)];
    trial = try_ambient(trial.lamp, known_ambient, places, samples);
  });
  const Trial& best = *std::ranges::min_element(trials, {}, &Trial::cost);
  const double usual = unevenness(light_on(places, light.lamp), *light.ambient, samples);
  if (!(best.cost < (1 - least_gain) * usual)) return light;
  light.lamp = best.lamp;
  light.ambient = best.ambient;
  return light;
}

}  // namespace pagesweep
