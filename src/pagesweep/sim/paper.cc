// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/paper.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "pagesweep/base/parallel.h"
#include "pagesweep/sim/profile.h"
#include "pagesweep/sim/relax_sheet.h"

namespace pagesweep::sim {
namespace {

constexpr double beyond_mm = 6;  ///< how far the base surface is known beyond the sheet's edges
constexpr double relax_spacing_mm = 2;
constexpr double crumple_refinement = 0.2;  ///< spacing of a crumpled sheet's mesh over that of others

bool runs_across(SheetEdge anchor) { return anchor == SheetEdge::left || anchor == SheetEdge::right; }

/// Where the sheet's paper lies in the frame of its profile: r counted from the anchored edge, q along that edge from
/// its middle, away from the apex.
struct ProfileFrame {
  explicit ProfileFrame(const SheetShape& shape)
      : anchor(shape.anchor),
        length(runs_across(anchor) ? shape.width_mm : shape.height_mm),
        breadth(runs_across(anchor) ? shape.height_mm : shape.width_mm),
        apex_side(shape.apex_mm > 0 ? 1 : -1) {}

  Eigen::Vector2d rq_of(double s, double t) const {
    const double from_start = runs_across(anchor) ? s : t, along = runs_across(anchor) ? t : s;
    const bool forward = anchor == SheetEdge::left || anchor == SheetEdge::top;
    return {forward ? from_start : length - from_start, apex_side * (along - 0.5 * breadth)};
  }
  /// Directions of q, r and up in the rig frame, as columns.
  Eigen::Matrix3d axes(double turn_rad) const {
    const Eigen::Vector3d right = Eigen::Vector3d::UnitX(), down = -Eigen::Vector3d::UnitY();
    Eigen::Matrix3d axes;
    axes.col(0) = apex_side * (runs_across(anchor) ? down : right);
    switch (anchor) {
      case SheetEdge::left:
        axes.col(1) = right;
        break;
      case SheetEdge::right:
        axes.col(1) = -right;
        break;
      case SheetEdge::top:
        axes.col(1) = down;
        break;
      case SheetEdge::bottom:
        axes.col(1) = -down;
        break;
    }
    axes.col(2) = Eigen::Vector3d::UnitZ();
    return Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix() * axes;
  }

  SheetEdge anchor;
  double length, breadth;
  double apex_side;
};

/// The developable surface on which the sheet lies: a cone.
class BaseSurface {
 public:
  explicit BaseSurface(const SheetShape& shape)
      : frame_(shape),
        apex_distance_(std::abs(shape.apex_mm)),
        slopes_(shape.slopes),
        rulings_(slopes_, apex_distance_, -beyond_mm, reach(), frame_.axes(shape.turn_rad)),
        apex_(shape.at_mm - apex_distance_ * frame_.axes(shape.turn_rad).col(0)) {}

  Eigen::Vector3d lift(double s, double t, double height) const {
    const auto [point, normal] = at(s, t);
    return point + height * normal;
  }
  std::pair<Eigen::Vector3d, Eigen::Vector3d> at(double s, double t) const {
    const Eigen::Vector2d rq = frame_.rq_of(s, t);
    const double from_apex = rq.y() + apex_distance_;
    const auto direction = rulings_.at(std::atan2(rq.x(), from_apex));
    return {apex_ + std::hypot(rq.x(), from_apex) * direction.ruling, direction.normal};
  }
  /// Parameter lines across the profile, closer where it bends.
  std::vector<double> profile_lines(double spacing) const {
    const double largest_turn = 2 * std::numbers::pi / 180;
    std::vector<double> lines{0};
    while (lines.back() < frame_.length) {
      const double here = lines.back();
      double step = spacing;
      while (step > 0.02 && std::abs(slopes_.slope_rad(here + step) - slopes_.slope_rad(here)) > largest_turn)
        step *= 0.7;
      lines.push_back(here + step);
    }
    lines.back() = frame_.length;
    if (lines.size() > 2 && frame_.length - lines[lines.size() - 2] < 0.3 * spacing) lines.erase(lines.end() - 2);
    const bool forward = frame_.anchor == SheetEdge::left || frame_.anchor == SheetEdge::top;
    if (!forward) {
      for (double& line : lines) line = frame_.length - line;
      std::ranges::reverse(lines);
    }
    return lines;
  }

 private:
  /// Arc length of the profile, at the apex' distance, that the sheet needs.
  double reach() const {
    const double nearest = apex_distance_ - 0.5 * frame_.breadth - beyond_mm;
    return std::atan2(frame_.length + beyond_mm, nearest) * apex_distance_ + 1;
  }

  ProfileFrame frame_;
  double apex_distance_;
  SlopeCurve slopes_;
  RulingCurve rulings_;
  Eigen::Vector3d apex_;
};

double height_of(const std::vector<Dent>& dents, double s, double t) {
  double height = 0;
  for (const Dent& dent : dents) {
    const Eigen::Vector2d offset = Eigen::Rotation2Dd(-dent.turn_rad) * Eigen::Vector2d(s - dent.s_mm, t - dent.t_mm);
    const double a = offset.x() / dent.radius_s_mm, b = offset.y() / dent.radius_t_mm;
    height += dent.height_mm * std::exp(-0.5 * (a * a + b * b));
  }
  return height;
}

/// Distances of a spot from both edges at a corner, inwards.
Eigen::Vector2d from_corner(SheetCorner corner, double s, double t, double width_mm, double height_mm) {
  const bool left = corner == SheetCorner::top_left || corner == SheetCorner::bottom_left;
  const bool top = corner == SheetCorner::top_left || corner == SheetCorner::top_right;
  return {left ? s : width_mm - s, top ? t : height_mm - t};
}

/// Where a spot would lie if its corner rolled up on a flat sheet, and how high above it.
Eigen::Vector3d roll(const SheetShape& shape, double s, double t) {
  Eigen::Vector3d place(s, t, 0);
  for (const Curl& curl : shape.curls) {
    const Eigen::Vector2d inwards = from_corner(curl.corner, s, t, shape.width_mm, shape.height_mm);
    const double beyond = curl.length_mm - (inwards.x() + inwards.y()) / std::numbers::sqrt2;
    if (!(beyond > 0)) continue;
    const double angle = beyond / curl.radius_mm;
    const double back = (beyond - curl.radius_mm * std::sin(angle)) / std::numbers::sqrt2;
    place.x() += s < 0.5 * shape.width_mm ? back : -back;
    place.y() += t < 0.5 * shape.height_mm ? back : -back;
    place.z() += curl.radius_mm * (1 - std::cos(angle));
  }
  return place;
}

/// How far the paper slides along the base, on a grid of its own; linear in between.
class Sliding {
 public:
  Sliding(const SheetShape& shape, const BaseSurface& base)
      : s_(even_lines(shape.width_mm, relax_spacing_mm)), t_(even_lines(shape.height_mm, relax_spacing_mm)) {
    Image<double> heights(static_cast<int>(s_.size()), static_cast<int>(t_.size()));
    for (int j = 0; j < heights.height(); ++j)
      for (int i = 0; i < heights.width(); ++i)
        heights(i, j) = height_of(shape.dents, s_[std::size_t(i)], t_[std::size_t(j)]);
    const auto anchored = [&](int i, int j) {
      switch (shape.anchor) {
        case SheetEdge::left:
          return i == 0;
        case SheetEdge::right:
          return i + 1 == heights.width();
        case SheetEdge::top:
          return j == 0;
        default:
          return j + 1 == heights.height();
      }
    };
    const Lift lift = [&](double s, double t, double height) { return base.lift(s, t, height); };
    shift_ = relax_sheet(s_, t_, heights, lift, anchored);
  }
  /// Cubic (Catmull-Rom) in both directions, so that the mesh is as smooth as the dents.
  Eigen::Vector2d at(double s, double t) const {
    const double x = s / (s_[1] - s_[0]), y = t / (t_[1] - t_[0]);
    const int i = std::clamp(static_cast<int>(x), 0, shift_.width() - 2);
    const int j = std::clamp(static_cast<int>(y), 0, shift_.height() - 2);
    const auto weights_x = weights(x - i), weights_y = weights(y - j);
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (int b = 0; b < 4; ++b)
      for (int a = 0; a < 4; ++a)
        sum += weights_x[std::size_t(a)] * weights_y[std::size_t(b)] * node(i + a - 1, j + b - 1);
    return sum;
  }

 private:
  static std::array<double, 4> weights(double x) {
    return {0.5 * x * (x * (2 - x) - 1), 0.5 * (x * x * (3 * x - 5) + 2), 0.5 * x * (x * (4 - 3 * x) + 1),
            0.5 * x * x * (x - 1)};
  }
  Eigen::Vector2d node(int i, int j) const {
    const int column = std::clamp(i, 0, shift_.width() - 1), row = std::clamp(j, 0, shift_.height() - 1);
    return shift_(column, row);
  }
  std::vector<double> s_, t_;
  Image<Eigen::Vector2d> shift_;
};

/// Normals of a lifted surface from differences over 0.2 mm of paper.
Eigen::Vector3d normal_of(const Lift& surface, double s, double t) {
  const double h = 0.1;
  const Eigen::Vector3d along_s = surface(s + h, t, 0) - surface(s - h, t, 0);
  const Eigen::Vector3d along_t = surface(s, t + h, 0) - surface(s, t - h, 0);
  return along_t.cross(along_s).normalized();
}

/// Cuts the torn corners out of the mesh, cell by cell.
void tear(const SheetShape& shape, GridMesh& mesh) {
  if (shape.tears.empty()) return;
  mesh.missing = Image<std::uint8_t>(mesh.columns() - 1, mesh.rows() - 1, 0);
  for (int j = 0; j + 1 < mesh.rows(); ++j)
    for (int i = 0; i + 1 < mesh.columns(); ++i) {
      const double s = 0.5 * (mesh.s[std::size_t(i)] + mesh.s[std::size_t(i) + 1]);
      const double t = 0.5 * (mesh.t[std::size_t(j)] + mesh.t[std::size_t(j) + 1]);
      for (const Tear& part : shape.tears)
        if (part.takes(s, t, shape.width_mm, shape.height_mm)) mesh.missing(i, j) = 1;
    }
}

/// Creases are sharp: the mesh cuts them off by a fraction of its spacing, which has to be small.
Sheet crumple_sheet(const SheetShape& shape, double spacing_mm) {
  const CrumpledSheet crumpled(shape.width_mm, shape.height_mm, shape.crumple);
  const Eigen::AngleAxisd turn(shape.turn_rad, Eigen::Vector3d::UnitZ());
  const Lift surface = [&](double s, double t, double) -> Eigen::Vector3d {
    return shape.at_mm + turn * crumpled.at(s, t);
  };
  Sheet sheet;
  GridMesh& mesh = sheet.mesh;
  mesh = GridMesh(even_lines(shape.width_mm, spacing_mm), even_lines(shape.height_mm, spacing_mm));
  parallel_rows(mesh.rows(), [&](int j) {
    for (int i = 0; i < mesh.columns(); ++i) {
      const double s = mesh.s[std::size_t(i)], t = mesh.t[std::size_t(j)];
      mesh.positions(i, j) = surface(s, t, 0);
      mesh.normals(i, j) = normal_of(surface, s, t).cast<float>();
    }
  });
  sheet.largest_strain = largest_strain(mesh);
  return sheet;
}

}  // namespace

bool Tear::takes(double s_mm, double t_mm, double width_mm, double height_mm) const {
  const Eigen::Vector2d inwards = from_corner(corner, s_mm, t_mm, width_mm, height_mm);
  const double a = inwards.x() / along_s_mm, b = inwards.y() / along_t_mm;
  // Rags of several lengths, along the line.
  const double along = a - b;
  const double rags = 0.03 * std::sin(9 * along + 1) + 0.02 * std::sin(23 * along) + 0.012 * std::sin(57 * along + 2);
  return a + b < 1 + rags;
}

Sheet bend_sheet(const SheetShape& shape, double spacing_mm) {
  if (shape.crumple.folds > 0) {
    Sheet sheet = crumple_sheet(shape, crumple_refinement * spacing_mm);
    tear(shape, sheet.mesh);
    return sheet;
  }
  const BaseSurface base(shape);
  const bool across = runs_across(shape.anchor);
  Sheet sheet;
  sheet.mesh = GridMesh(across ? base.profile_lines(spacing_mm) : even_lines(shape.width_mm, spacing_mm),
                        across ? even_lines(shape.height_mm, spacing_mm) : base.profile_lines(spacing_mm));
  GridMesh& mesh = sheet.mesh;
  std::optional<Sliding> sliding;
  if (!shape.dents.empty()) sliding.emplace(shape, base);
  const bool is_plain = shape.dents.empty() && shape.curls.empty();
  const Lift formed = [&](double s, double t, double) {
    const Eigen::Vector2d shift = sliding ? sliding->at(s, t) : Eigen::Vector2d::Zero();
    const Eigen::Vector3d rolled = roll(shape, s + shift.x(), t + shift.y());
    return base.lift(rolled.x(), rolled.y(), rolled.z() + height_of(shape.dents, s, t));
  };
  parallel_rows(mesh.rows(), [&](int j) {
    for (int i = 0; i < mesh.columns(); ++i) {
      const double s = mesh.s[std::size_t(i)], t = mesh.t[std::size_t(j)];
      const auto [point, normal] = base.at(s, t);
      mesh.positions(i, j) = is_plain ? point : formed(s, t, 0);
      mesh.normals(i, j) = (is_plain ? normal : normal_of(formed, s, t)).cast<float>();
    }
  });
  sheet.largest_strain = largest_strain(mesh);
  tear(shape, mesh);
  return sheet;
}

}  // namespace pagesweep::sim
