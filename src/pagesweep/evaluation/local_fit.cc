// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/local_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "pagesweep/evaluation/statistics.h"

namespace pagesweep {
namespace {

/// A measured point in the frame of the central pixel's ray, lengths over the neighbourhood's radius.
struct Sample {
  double a, b;    ///< across the ray
  double height;  ///< along it, towards the camera [mm]
  double weight;  ///< 1 / sigma^2, up to a factor
};

/// The polynomial's terms: N = 3 for a plane, 6 for a quadric.
template <int N>
Eigen::Matrix<double, N, 1> terms_at(const Sample& s) {
  if constexpr (N == 3)
    return {1, s.a, s.b};
  else
    return Eigen::Matrix<double, N, 1>{1, s.a, s.b, s.a * s.a, s.a * s.b, s.b * s.b};
}

std::vector<Sample> gather(const PointMap& points, int x, int y, const Eigen::Vector3d& center, double radius_mm) {
  const auto point_at = [&](int i, int j) -> Eigen::Vector3d {
    return Eigen::Vector3f(points.x(i, j), points.y(i, j), points.z(i, j)).cast<double>();
  };
  const Eigen::Vector3d origin = point_at(x, y);
  const Eigen::Vector3d to_camera = (center - origin).normalized();
  const Eigen::Vector3d across_a = to_camera.unitOrthogonal();
  const Eigen::Vector3d across_b = to_camera.cross(across_a);
  std::vector<Sample> samples;
  // Rings of pixels around the centre, until one lies outside the neighbourhood as a whole.
  constexpr int most_rings = 60;
  bool ring_reaches_in = true;
  for (int ring = 0; ring_reaches_in && ring < most_rings; ++ring) {
    ring_reaches_in = ring == 0;
    for (int j = y - ring; j <= y + ring; ++j)
      for (int i = x - ring; i <= x + ring; i += std::abs(j - y) == ring ? 1 : std::max(1, 2 * ring)) {
        if (i < 0 || j < 0 || i >= points.width() || j >= points.height()) continue;
        if (points.status(i, j) != PixelStatus::ok) {
          ring_reaches_in |= ring < 3;
          continue;
        }
        const Eigen::Vector3d offset = point_at(i, j) - origin;
        const double a = offset.dot(across_a) / radius_mm, b = offset.dot(across_b) / radius_mm;
        if (!(a * a + b * b <= 1)) continue;
        ring_reaches_in = true;
        const double sigma = points.sigma(i, j);
        samples.push_back({a, b, offset.dot(to_camera), sigma > 0 ? 1 / (sigma * sigma) : 0});
      }
  }
  if (std::all_of(samples.begin(), samples.end(), [](const Sample& s) { return s.weight == 0; }))
    for (Sample& sample : samples) sample.weight = 1;
  return samples;
}

/// Whether the centre is inside the samples rather than at their rim, where a fit extrapolates.
bool surround_the_centre(const std::vector<Sample>& samples) {
  double a = 0, b = 0;
  for (const Sample& sample : samples) {
    a += sample.a;
    b += sample.b;
  }
  constexpr double most = 0.2;  // of the radius; half a disk has its centre of mass at 0.42
  return std::hypot(a, b) < most * static_cast<double>(samples.size());
}

/// Height of the fitted polynomial at the centre; nothing if the samples do not determine it.
template <int N>
std::optional<double> fit_height(const std::vector<Sample>& samples) {
  if (samples.size() < 2 * N) return std::nullopt;
  std::vector<double> robust(samples.size(), 1), sizes(samples.size());
  double height = 0;
  for (int round = 0; round < 4; ++round) {
    Eigen::Matrix<double, N, N> normal = Eigen::Matrix<double, N, N>::Zero();
    Eigen::Matrix<double, N, 1> right = Eigen::Matrix<double, N, 1>::Zero();
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const auto terms = terms_at<N>(samples[i]);
      const double weight = robust[i] * samples[i].weight;
      normal += weight * terms * terms.transpose();
      right += weight * samples[i].height * terms;
    }
    const Eigen::LDLT<Eigen::Matrix<double, N, N>> factors(normal);
    if (factors.info() != Eigen::Success || !(factors.rcond() > 1e-9)) return std::nullopt;
    const Eigen::Matrix<double, N, 1> solution = factors.solve(right);
    height = solution[0];
    for (std::size_t i = 0; i < samples.size(); ++i)
      sizes[i] = std::abs(samples[i].height - terms_at<N>(samples[i]).dot(solution));
    const double limit = 4.685 * 1.4826 * median_of(sizes);  // Tukey's 95 % efficiency at a Gaussian
    if (!(limit > 0)) break;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const double r = sizes[i] / limit;
      robust[i] = r < 1 ? (1 - r * r) * (1 - r * r) : 0;
    }
  }
  return height;
}

}  // namespace

std::optional<Eigen::Vector3d> fit_locally(const PointMap& points, int x, int y, const Eigen::Vector3d& camera_center,
                                           double diameter_mm, LocalFit model) {
  const std::vector<Sample> samples = gather(points, x, y, camera_center, diameter_mm / 2);
  if (!surround_the_centre(samples)) return std::nullopt;
  const auto height = model == LocalFit::plane ? fit_height<3>(samples) : fit_height<6>(samples);
  if (!height) return std::nullopt;
  const Eigen::Vector3d own(points.x(x, y), points.y(x, y), points.z(x, y));
  return own + *height * (camera_center - own).normalized();
}

}  // namespace pagesweep
