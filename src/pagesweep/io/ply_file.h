// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "pagesweep/data/point_map.h"

namespace pagesweep {

/// Measured points without their pixels. All vectors have one entry a point.
struct PointCloud {
  std::vector<Eigen::Vector3f> points;   ///< [mm] rig frame
  std::vector<Eigen::Vector3f> normals;  ///< unit length, towards the camera; NaN: unknown
  std::vector<float> intensity;          ///< [gray values] NaN: unknown
  std::vector<float> sigma;              ///< [mm] one standard deviation along the viewing ray; NaN: unknown
  std::vector<std::uint8_t> camera;      ///< 1 for the rig's first camera, ...; 0: unknown

  std::size_t size() const { return points.size(); }
};

/// The points with status ok of all cameras, in their order, row by row.
PointCloud gather_points(std::span<const PointMap> cameras);

/// Writes a binary little-endian PLY: x y z nx ny nz intensity sigma (float), camera (uchar).
/// \throws Error  if it cannot be written
/// \throws std::invalid_argument  if the vectors' lengths differ
void write_ply(const std::filesystem::path& file, const PointCloud& cloud);
void write_ply(const std::filesystem::path& file, std::span<const PointMap> cameras);

/// Reads the vertices of any PLY, ascii or binary, whatever the order and types of their properties. x, y, z are
/// required; what else is missing is unknown.
/// \throws Error  if the file cannot be read, is cut short, or is no PLY
PointCloud read_ply(const std::filesystem::path& file);

}  // namespace pagesweep
