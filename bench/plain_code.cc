// SPDX-License-Identifier: Apache-2.0
#include "bench/plain_code.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "pagesweep/timing/bell_fit.h"

namespace pagesweep::bench::plain {
namespace {

constexpr double most_disagreement_px = 0.5;

/// Value between four pixels; NaN if one of them is, or is not in the picture.
double between(const Image<float>& image, double u, double v) {
  const int x = static_cast<int>(std::floor(u)), y = static_cast<int>(std::floor(v));
  if (x < 0 || y < 0 || x + 1 >= image.width() || y + 1 >= image.height()) return std::nan("");
  const double a = u - x, b = v - y;
  const auto at = [&](int i, int j) { return static_cast<double>(image(x + i, y + j)); };
  return (1 - b) * ((1 - a) * at(0, 0) + a * at(1, 0)) + b * ((1 - a) * at(0, 1) + a * at(1, 1));
}

/// Whether the place that (x, y) is matched with is matched with (x, y)
bool agrees(const Correspondences& back, double u, double v, int x, int y) {
  return std::hypot(between(back.u, u, v) - x, between(back.v, u, v) - y) <= most_disagreement_px;
}

/// Leaves what the other direction confirms.
void keep_agreeing(Correspondences& there, const Correspondences& back) {
  for (int y = 0; y < there.height(); ++y)
    for (int x = 0; x < there.width(); ++x)
      if (there.status(x, y) == PixelStatus::ok &&
          !agrees(back, static_cast<double>(there.u(x, y)), static_cast<double>(there.v(x, y)), x, y))
        there.status(x, y) = PixelStatus::no_match;
}

/// Calls find(curve, x, y), which returns how many places along its curve, from place 0, the pixel's match is.
template <class Find>
Correspondences match_one_way(const EpipolarGeometry& curves, int width, int height, const Find& find) {
  Correspondences matches(width, height);
  CurveSamples places;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      matches.status(x, y) = PixelStatus::no_match;
      sample(curves.curve(x, y), places);
      const std::optional<double> found = find(places, x, y);
      if (!found) continue;
      const auto i = static_cast<std::size_t>(std::floor(*found));
      const auto rest = static_cast<float>(*found - std::floor(*found));
      const std::size_t next = std::min(i + 1, places.u.size() - 1);
      matches.u(x, y) = (1 - rest) * places.u[i] + rest * places.u[next];
      matches.v(x, y) = (1 - rest) * places.v[i] + rest * places.v[next];
      matches.status(x, y) = PixelStatus::ok;
    }
  return matches;
}

/// Where the sign of time minus wanted time changes first.
std::optional<double> find_time(const TimeMap& times, const CurveSamples& places, double wanted) {
  double before = std::nan("");
  for (std::size_t i = 0; i < places.u.size(); ++i) {
    const double later =
        between(times.time, static_cast<double>(places.u[i]), static_cast<double>(places.v[i])) - wanted;
    if (before * later <= 0 && before != later) return static_cast<double>(i) - 1 + before / (before - later);
    before = later;
  }
  return std::nullopt;
}

/// All frames of a camera as pictures of floats.
std::vector<Image<float>> pictures_of(const Frames& frames) {
  std::vector<Image<float>> pictures(static_cast<std::size_t>(frames.count()), {frames.width(), frames.height()});
  Image<float> samples;
  for (int y = 0; y < frames.height(); ++y) {
    frames.read_row(y, samples);
    for (int i = 0; i < frames.count(); ++i)
      std::ranges::copy(samples.row(i), pictures[static_cast<std::size_t>(i)].row(y).begin());
  }
  return pictures;
}

/// Takes mean and energy away. \return whether there was any
bool normalise(std::vector<double>& sequence) {
  double mean = 0, energy = 0;
  for (const double sample : sequence) mean += sample / static_cast<double>(sequence.size());
  for (double& sample : sequence) sample -= mean, energy += sample * sample;
  for (double& sample : sequence) sample /= std::sqrt(energy);
  return energy > 0;
}

std::optional<double> find_sequence(const std::vector<Image<float>>& other, const CurveSamples& places,
                                    std::vector<double> wanted) {
  if (!normalise(wanted)) return std::nullopt;
  std::vector<double> correlation(places.u.size(), -1), sequence(wanted.size());
  for (std::size_t i = 0; i < places.u.size(); ++i) {
    for (std::size_t k = 0; k < sequence.size(); ++k)
      sequence[k] = between(other[k], static_cast<double>(places.u[i]), static_cast<double>(places.v[i]));
    if (!normalise(sequence)) continue;
    correlation[i] = 0;
    for (std::size_t k = 0; k < sequence.size(); ++k) correlation[i] += wanted[k] * sequence[k];
  }
  const auto best = static_cast<std::size_t>(std::ranges::max_element(correlation) - correlation.begin());
  if (best == 0 || best + 1 >= correlation.size() || !(correlation[best] > 0.8)) return std::nullopt;
  const double bend = correlation[best - 1] - 2 * correlation[best] + correlation[best + 1];
  return static_cast<double>(best) + 0.5 * (correlation[best - 1] - correlation[best + 1]) / bend;
}

std::vector<double> sequence_of(const std::vector<Image<float>>& pictures, int x, int y) {
  std::vector<double> sequence;
  for (const Image<float>& picture : pictures) sequence.push_back(static_cast<double>(picture(x, y)));
  return sequence;
}

}  // namespace

TimeMap estimate_times(const Frames& frames, const StripeProfile& profile, const SensorNoise& noise) {
  TimeMap times(frames.width(), frames.height());
  const FrameNoise frame_noise(noise);
  const int reach = static_cast<int>(std::ceil(std::max(-profile.begin(), profile.end())));
  Image<float> samples;
  std::vector<float> sequence(static_cast<std::size_t>(frames.count()));
  for (int y = 0; y < frames.height(); ++y) {
    frames.read_row(y, samples);
    for (int x = 0; x < frames.width(); ++x) {
      for (int i = 0; i < frames.count(); ++i) sequence[static_cast<std::size_t>(i)] = samples(x, i);
      const int middle = static_cast<int>(std::ranges::max_element(sequence) - sequence.begin());
      const int first = std::max(0, middle - reach), end = std::min(frames.count(), middle + reach + 1);
      const std::span window =
          std::span(sequence).subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(end - first));
      const auto [lowest, highest] = std::ranges::minmax(window);
      const Bell start{static_cast<double>(highest - lowest), static_cast<double>(lowest), static_cast<double>(middle)};
      const BellFit fit = fit_bell(window, first, profile, frame_noise, start);
      if (!fit.converged) continue;
      times.time(x, y) = static_cast<float>(fit.bell.time);
      times.sigma(x, y) = static_cast<float>(fit.time_sigma());
      times.amplitude(x, y) = static_cast<float>(fit.bell.amplitude);
      times.status(x, y) = PixelStatus::ok;
    }
  }
  return times;
}

Correspondences match_times(const TimeMap& first, const TimeMap& second, const RayTable& first_camera,
                            const RayTable& second_camera, InverseDepthRange depths) {
  const auto match = [&](const TimeMap& from, const TimeMap& to, const RayTable& from_camera,
                         const RayTable& to_camera) {
    return match_one_way({from_camera, to_camera, depths}, from.width(), from.height(),
                         [&](const CurveSamples& places, int x, int y) -> std::optional<double> {
                           if (from.status(x, y) != PixelStatus::ok) return std::nullopt;
                           return find_time(to, places, static_cast<double>(from.time(x, y)));
                         });
  };
  Correspondences there = match(first, second, first_camera, second_camera);
  keep_agreeing(there, match(second, first, second_camera, first_camera));
  return there;
}

Correspondences match_sequences(const Frames& first, const Frames& second, const RayTable& first_camera,
                                const RayTable& second_camera, InverseDepthRange depths) {
  const std::vector<Image<float>> first_pictures = pictures_of(first), second_pictures = pictures_of(second);
  const auto match = [&](const auto& from, const auto& to, const RayTable& from_camera, const RayTable& to_camera) {
    return match_one_way(
        {from_camera, to_camera, depths}, from_camera.width(), from_camera.height(),
        [&](const CurveSamples& places, int x, int y) { return find_sequence(to, places, sequence_of(from, x, y)); });
  };
  Correspondences there = match(first_pictures, second_pictures, first_camera, second_camera);
  keep_agreeing(there, match(second_pictures, first_pictures, second_camera, first_camera));
  return there;
}

PointMap triangulate(const Correspondences& matches, const RayTable& from, const RayTable& to) {
  PointMap points(matches.width(), matches.height());
  const Rigid3 rig_from_first = from.camera().cam_from_rig.inverse(),
               rig_from_second = to.camera().cam_from_rig.inverse();
  for (int y = 0; y < matches.height(); ++y)
    for (int x = 0; x < matches.width(); ++x) {
      if (matches.status(x, y) != PixelStatus::ok) continue;
      const Eigen::Vector2d place(matches.u(x, y), matches.v(x, y));
      const Eigen::Vector3d a = rig_from_first.rotation * from.direction(x, y).homogeneous().normalized(),
                            b = rig_from_second.rotation * to.direction_at(place).homogeneous().normalized();
      const Eigen::Vector3d normal =
          b.cross(a.cross(b));  // of the plane through the other ray, square to both rays' normal
      const Eigen::Vector3d point =
          rig_from_first.translation +
          normal.dot(rig_from_second.translation - rig_from_first.translation) / normal.dot(a) * a;
      points.x(x, y) = static_cast<float>(point.x());
      points.y(x, y) = static_cast<float>(point.y());
      points.z(x, y) = static_cast<float>(point.z());
      points.status(x, y) = PixelStatus::ok;
    }
  return points;
}

}  // namespace pagesweep::bench::plain
