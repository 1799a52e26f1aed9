// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pagesweep/base/enum_names.h"
#include "pagesweep/camera/rigid3.h"
#include "pagesweep/camera/scanner.h"
#include "pagesweep/data/board.h"

namespace pagesweep {

/// How a real board differs from its definition: stretched along y and shrunk along x by half of `stretch` each, and
/// bent to z = sum_k bend[k] b_k(x, y), the products P_m(x) P_n(y) of Legendre polynomials with 2 <= m + n <= 4 over
/// the board's extent. Heights in mm. What a pose can do as well, shifts and tilts, is not among them; nor is its size,
/// which no picture tells.
struct BoardShape {
  static constexpr int bends = 12;
  double stretch = 0;
  std::array<double, bends> bend_mm{};

  /// A corner in the board frame [mm].
  Eigen::Vector3d corner_mm(const Board& board, int corner) const;
};

/// A board's corner in a picture.
struct Observation {
  int sensor = 0;         ///< index of Bundle::sensors
  int pose = 0;           ///< index of Bundle::rig_from_board
  int corner = 0;         ///< see Board::corner_mm()
  Eigen::Vector2d pixel;  ///< [px]
  bool used = true;       ///< false: an outlier, without influence
};

/// Which of a lens' distortion parameters are estimated; the others stay zero.
enum class LensModel { full, k1_k2_tangential, k1_k2, k1 };
constexpr auto names_of(LensModel) {
  return std::array<std::string_view, 4>{"full", "k1-k2-tangential", "k1-k2", "k1"};
}

/// One of the two cameras, or the scanner. Frame cameras stand as the model of a Scanner too.
struct Sensor {
  std::string name;
  Scanner::Model model;
  double sigma_px = 1;  ///< standard deviation of a coordinate of its corners: its observations' weight
  bool pose_is_held = false;
  bool inside_is_held = false;  ///< focal lengths, distortion, ...
};

/// All that is known and wanted.
struct Bundle {
  Board board;
  BoardShape shape;
  std::vector<Sensor> sensors;
  std::vector<Rigid3> rig_from_board;  ///< a pose each
  std::vector<bool> pose_is_held;      ///< likewise
  std::vector<Observation> observations;

  /// Where a sensor should see a corner; nothing if it cannot. For circles, the middle of their picture.
  std::optional<Eigen::Vector2d> predict(int sensor, int pose, int corner) const;
  /// Seen minus predicted [px]; NaN where nothing is predicted.
  Eigen::Vector2d residual(const Observation& observation) const;
};

struct BundleOptions {
  LensModel lens = LensModel::full;
  bool fit_stretch = false;
  bool fit_bend = false;
  double robust_scale =
      0;  ///< in standard deviations; beyond it, errors count less and less (Cauchy); 0: least squares
  bool with_covariance = false;
};

/// An estimated parameter.
struct Parameter {
  std::string owner;  ///< the sensor's name, "board", or "pose 3"
  std::string name;   ///< "fx", "turn_x", "center_z", ...
  std::string unit;   ///< "" for a number
  double value = 0;
};

struct BundleSolution {
  int iterations = 0;
  double redundancy = 0;              ///< observed coordinates minus estimated parameters
  double unit_sigma = 1;              ///< standard deviation of an observation of unit weight, after the adjustment
  std::vector<Parameter> parameters;  ///< of sensors and board; poses of boards come last
  Eigen::MatrixXd covariance;         ///< of all of them, a posteriori: times unit_sigma^2; empty if not asked for
  std::string problem;                ///< "" unless the observations leave a parameter open: says which
};

/// Least squares over everything that is not held, by Levenberg-Marquardt with the poses eliminated first (Ceres).
///
/// A sensor's pose is its centre and a small turn (turn_x, turn_y, turn_z) [rad] about the rig's axes that is applied
/// before its present rotation: X_c = R exp([turn]x) (X_rig - center). Covariances refer to this, with turn = 0.
/// \throws Error  if the start values are so far off that nothing can be computed
BundleSolution solve(Bundle& bundle, const BundleOptions& options);

/// What a sensor of this kind has as parameters, in the order in which solve() lists them: "fx", ..., "center_z".
std::vector<std::string> parameter_names(const Scanner::Model& model);

/// d (pixel of a rig point) / d (parameters of a sensor), in the order of parameter_names(): 2 x their number.
Eigen::MatrixXd parameter_jacobian(const Scanner::Model& model, const Eigen::Vector3d& rig_point);

}  // namespace pagesweep
