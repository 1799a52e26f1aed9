// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "pagesweep/base/image.h"

namespace pagesweep::sim {

/// A place on a mesh: three of its nodes and their weights, which sum to 1.
struct MeshSpot {
  std::array<std::uint32_t, 3> node{};
  std::array<float, 3> weight{};
};

/// A surface over a grid of parameter lines (s, t), which need not be evenly spaced. Node (i, j) has the number
/// j * columns + i. Each cell is two triangles; cell (i, j) has the triangles 2 (j (columns - 1) + i) and the next.
struct GridMesh {
  GridMesh() = default;
  GridMesh(std::vector<double> s_lines, std::vector<double> t_lines);

  std::vector<double> s, t;          ///< [mm] ascending
  Image<Eigen::Vector3d> positions;  ///< [mm] rig frame
  Image<Eigen::Vector3f> normals;    ///< unit length, away from the table
  Image<std::uint8_t> missing = {};  ///< cells that are torn off; empty: none

  int columns() const { return positions.width(); }
  int rows() const { return positions.height(); }
  std::size_t nodes() const { return positions.size(); }

  /// The nodes of a triangle.
  std::array<std::uint32_t, 3> triangle(std::uint32_t index) const;
  int triangle_count() const { return 2 * (columns() - 1) * (rows() - 1); }
  /// Whether a triangle is torn off.
  bool is_missing(std::uint32_t triangle) const { return !missing.pixels().empty() && missing.pixels()[triangle / 2]; }
  /// Whether the spot at (s, t) is.
  bool is_missing(double s_mm, double t_mm) const;
  /// The spot at (s, t), which is clamped to the grid.
  MeshSpot spot_at(double s_mm, double t_mm) const;
  Eigen::Vector3d point(const MeshSpot& spot) const;
  Eigen::Vector3f normal(const MeshSpot& spot) const;      ///< interpolated, not normalised
  Eigen::Vector2f parameters(const MeshSpot& spot) const;  ///< (s, t) [mm]
};

/// Ascending values from 0 to `length`, evenly spaced by at most `spacing`.
std::vector<double> even_lines(double length, double spacing);

/// The horizontal rectangle with a corner at (x, y), (s, t) growing with x and y.
GridMesh make_rectangle(const Eigen::Vector3d& corner, double width_mm, double depth_mm, double spacing_mm);

/// A sphere; s and t are longitude and latitude times the radius.
GridMesh make_sphere(const Eigen::Vector3d& center, double radius_mm, double spacing_mm);

/// The upright walls from a sheet's edges (left, right, top, bottom) down to the table at z = 0.
std::array<GridMesh, 4> make_walls(const GridMesh& sheet);

/// Largest relative difference between the length of a cell's side or diagonal and its length in (s, t).
double largest_strain(const GridMesh& mesh);

}  // namespace pagesweep::sim
