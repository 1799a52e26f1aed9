// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "pagesweep/camera/light.h"
#include "pagesweep/camera/scan_light.h"

namespace pagesweep {

/// What is known of the light in which a scan was taken. All of it may be missing.
struct ScanLight {
  std::optional<Light> sheet{};  ///< missing: upright, across the rig's y axis
  std::optional<LampBar> lamp{};
  std::optional<WhiteReference> white{};  ///< missing: the scanner has evened its picture out over the table, z = 0
  double stripe_fwhm_mm = 12;             ///< width of the lit stripe on the table
  /// Share of the light that comes from all around and falls alike on every slope: 1 where the scan is not a picture of
  /// the stripe's light, or was evened out already. Missing: to be found.
  std::optional<double> ambient{};
};

/// The directions of light at a place: unit vectors of the rig frame.
struct LightFrame {
  Eigen::Vector3d along;   ///< the stripe, and the bar that lights it
  Eigen::Vector3d up;      ///< within the sheet of light, at right angles to the bar, towards it
  Eigen::Vector3d normal;  ///< of the sheet
};

/// The light that falls on a spot of paper when the middle of the sheet passes it.
///
/// A bar of length L that sends light out as a matt surface does gives a spot at X with normal n
///     E = integral over x' of (n . r)(D / |r|) / |r|^3 dx',   r = D up + x' along,
/// with D the distance from the bar; the integral is known in closed form (docs/derivations/dewarping.md). Without a
/// known bar the light is taken to come from afar, E = n . up. Ambient light adds its share, the same everywhere.
class LampLight {
 public:
  explicit LampLight(const ScanLight& light) : light_(&light) {}

  LightFrame frame_at(const Eigen::Vector3d& point_mm) const;
  /// Irradiance relative to that of a level spot on the reference plane, `at_reference_mm` being where the same pixel
  /// of the scan sees that plane.
  double at(const Eigen::Vector3d& point_mm, const Eigen::Vector3d& normal,
            const Eigen::Vector3d& at_reference_mm) const;

 private:
  double irradiance(const Eigen::Vector3d& point, const Eigen::Vector3d& normal) const;
  const ScanLight* light_;
};

/// Blank paper at a spot, as the scan shows it.
struct PaperSample {
  Eigen::Vector3d point_mm, normal, at_reference_mm;
  double glow = 0;   ///< irradiance by way of the facing page, relative as LampLight::at()
  double light = 0;  ///< of the scan
  int sheet = 0;     ///< which piece of paper: each has its own colour
};

/// The light that makes each sheet's blank paper most even: the lamp's height and length, if `light` does not tell
/// them, and how much of the light is ambient, by the least sum of Geman and McClure's robust cost on a grid of all
/// three. Light from afar without any ambient light is what it has to explain better, clearly; a lamp can be told only
/// where paper does not lie level.
/// \param samples  sheet by sheet
/// \return `light` with what was found; with no ambient light where nothing shows any
ScanLight find_light(ScanLight light, std::span<const PaperSample> samples);

}  // namespace pagesweep
