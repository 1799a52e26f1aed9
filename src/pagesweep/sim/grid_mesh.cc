// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/grid_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace pagesweep::sim {
namespace {

/// The cell that holds a value, and where in it from 0 to 1.
struct CellPlace {
  std::uint32_t cell;
  double share;
};

CellPlace place_in(const std::vector<double>& lines, double value) {
  const auto after = std::upper_bound(lines.begin() + 1, lines.end() - 1, value);
  const auto cell = static_cast<std::size_t>(after - lines.begin() - 1);
  const double share = (value - lines[cell]) / (lines[cell + 1] - lines[cell]);
  return {static_cast<std::uint32_t>(cell), std::clamp(share, 0.0, 1.0)};
}

/// A wall of two rows: an edge and its shadow on the table.
GridMesh make_wall(const std::vector<Eigen::Vector3d>& edge, const Eigen::Vector3d& inside) {
  std::vector<double> along{0};
  for (std::size_t i = 1; i < edge.size(); ++i) along.push_back(along.back() + (edge[i] - edge[i - 1]).norm());
  GridMesh wall(along, {0, 1});
  for (int i = 0; i < wall.columns(); ++i) {
    const Eigen::Vector3d& top = edge[static_cast<std::size_t>(i)];
    const Eigen::Vector3d direction = edge[static_cast<std::size_t>(std::min(i + 1, wall.columns() - 1))] -
                                      edge[static_cast<std::size_t>(std::max(i - 1, 0))];
    Eigen::Vector3d outward(direction.y(), -direction.x(), 0);
    if (outward.dot(top - inside) < 0) outward = -outward;
    for (int j : {0, 1}) {
      wall.positions(i, j) = j == 0 ? top : Eigen::Vector3d(top.x(), top.y(), 0);
      wall.normals(i, j) = outward.normalized().cast<float>();
    }
  }
  return wall;
}

}  // namespace

GridMesh::GridMesh(std::vector<double> s_lines, std::vector<double> t_lines)
    : s(std::move(s_lines)),
      t(std::move(t_lines)),
      positions(static_cast<int>(s.size()), static_cast<int>(t.size())),
      normals(static_cast<int>(s.size()), static_cast<int>(t.size())) {}

std::array<std::uint32_t, 3> GridMesh::triangle(std::uint32_t index) const {
  const auto width = static_cast<std::uint32_t>(columns());
  const std::uint32_t cell = index / 2;
  const std::uint32_t node = cell / (width - 1) * width + cell % (width - 1);
  if (index % 2 == 0) return {node, node + 1, node + width};
  return {node + width + 1, node + width, node + 1};
}

MeshSpot GridMesh::spot_at(double s_mm, double t_mm) const {
  const CellPlace column = place_in(s, s_mm), row = place_in(t, t_mm);
  const std::uint32_t cell = row.cell * static_cast<std::uint32_t>(columns() - 1) + column.cell;
  const auto a = static_cast<float>(column.share), b = static_cast<float>(row.share);
  if (a + b <= 1) return {triangle(2 * cell), {1 - a - b, a, b}};
  return {triangle(2 * cell + 1), {a + b - 1, 1 - a, 1 - b}};
}

bool GridMesh::is_missing(double s_mm, double t_mm) const {
  if (missing.pixels().empty()) return false;
  return missing(static_cast<int>(place_in(s, s_mm).cell), static_cast<int>(place_in(t, t_mm).cell)) != 0;
}

Eigen::Vector3d GridMesh::point(const MeshSpot& spot) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < 3; ++k) sum += double(spot.weight[k]) * positions.pixels()[spot.node[k]];
  return sum;
}

Eigen::Vector3f GridMesh::normal(const MeshSpot& spot) const {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (std::size_t k = 0; k < 3; ++k) sum += spot.weight[k] * normals.pixels()[spot.node[k]];
  return sum;
}

Eigen::Vector2f GridMesh::parameters(const MeshSpot& spot) const {
  const auto width = static_cast<std::uint32_t>(columns());
  Eigen::Vector2f sum = Eigen::Vector2f::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint32_t node = spot.node[k];
    sum += spot.weight[k] * Eigen::Vector2f(float(s[node % width]), float(t[node / width]));
  }
  return sum;
}

std::vector<double> even_lines(double length, double spacing) {
  const int cells = std::max(1, static_cast<int>(std::ceil(length / spacing - 1e-9)));
  std::vector<double> lines;
  for (int i = 0; i <= cells; ++i) lines.push_back(length * i / cells);
  return lines;
}

GridMesh make_rectangle(const Eigen::Vector3d& corner, double width_mm, double depth_mm, double spacing_mm) {
  GridMesh mesh(even_lines(width_mm, spacing_mm), even_lines(depth_mm, spacing_mm));
  for (int j = 0; j < mesh.rows(); ++j)
    for (int i = 0; i < mesh.columns(); ++i) {
      mesh.positions(i, j) = corner + Eigen::Vector3d(mesh.s[std::size_t(i)], mesh.t[std::size_t(j)], 0);
      mesh.normals(i, j) = Eigen::Vector3f::UnitZ();
    }
  return mesh;
}

GridMesh make_sphere(const Eigen::Vector3d& center, double radius_mm, double spacing_mm) {
  using std::numbers::pi;
  GridMesh mesh(even_lines(2 * pi * radius_mm, spacing_mm), even_lines(pi * radius_mm, spacing_mm));
  for (int j = 0; j < mesh.rows(); ++j)
    for (int i = 0; i < mesh.columns(); ++i) {
      const double longitude = mesh.s[std::size_t(i)] / radius_mm, latitude = mesh.t[std::size_t(j)] / radius_mm;
      const Eigen::Vector3d outward(std::sin(latitude) * std::cos(longitude), std::sin(latitude) * std::sin(longitude),
                                    std::cos(latitude));
      mesh.positions(i, j) = center + radius_mm * outward;
      mesh.normals(i, j) = outward.cast<float>();
    }
  return mesh;
}

std::array<GridMesh, 4> make_walls(const GridMesh& sheet) {
  const int right = sheet.columns() - 1, bottom = sheet.rows() - 1;
  std::array<std::vector<Eigen::Vector3d>, 4> edges;
  for (int j = 0; j <= bottom; ++j) {
    edges[0].push_back(sheet.positions(0, j));
    edges[1].push_back(sheet.positions(right, j));
  }
  for (int i = 0; i <= right; ++i) {
    edges[2].push_back(sheet.positions(i, 0));
    edges[3].push_back(sheet.positions(i, bottom));
  }
  const Eigen::Vector3d middle = sheet.positions(right / 2, bottom / 2);
  return {make_wall(edges[0], middle), make_wall(edges[1], middle), make_wall(edges[2], middle),
          make_wall(edges[3], middle)};
}

double largest_strain(const GridMesh& mesh) {
  double largest = 0;
  const auto compare = [&](int i, int j, int i2, int j2) {
    const double flat =
        std::hypot(mesh.s[std::size_t(i2)] - mesh.s[std::size_t(i)], mesh.t[std::size_t(j2)] - mesh.t[std::size_t(j)]);
    const double length = (mesh.positions(i2, j2) - mesh.positions(i, j)).norm();
    largest = std::max(largest, std::abs(length / flat - 1));
  };
  for (int j = 0; j < mesh.rows(); ++j)
    for (int i = 0; i < mesh.columns(); ++i) {
      const bool has_right = i + 1 < mesh.columns(), has_below = j + 1 < mesh.rows();
      if (has_right) compare(i, j, i + 1, j);
      if (has_below) compare(i, j, i, j + 1);
      if (has_right && has_below) compare(i, j, i + 1, j + 1);
      if (has_right && has_below) compare(i + 1, j, i, j + 1);
    }
  return largest;
}

}  // namespace pagesweep::sim
