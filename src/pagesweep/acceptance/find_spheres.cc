// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/acceptance/find_spheres.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace pagesweep {
namespace {

// Shares of the radius.
constexpr double cell_share = 0.15;         // of the cells in which votes are counted
constexpr double reach_share = 0.2;         // votes this close to the centre belong to it
constexpr double fewest_votes_share = 0.3;  // of the points around a sphere that must agree on its centre
constexpr std::size_t fewest_votes = 20;

using Cell = std::array<long, 3>;

Cell cell_of(const Eigen::Vector3d& vote, double cell_mm) {
  return {std::lround(vote.x() / cell_mm), std::lround(vote.y() / cell_mm), std::lround(vote.z() / cell_mm)};
}

/// The mean of the votes in the fullest cell.
Eigen::Vector3d fullest_place(std::span<const Eigen::Vector3d> votes, double cell_mm) {
  std::vector<std::pair<Cell, std::size_t>> cells(votes.size());
  for (std::size_t i = 0; i < votes.size(); ++i) cells[i] = {cell_of(votes[i], cell_mm), i};
  std::sort(cells.begin(), cells.end());
  std::size_t best = 0, best_count = 0;
  for (std::size_t begin = 0, end = 0; begin < cells.size(); begin = end) {
    while (end < cells.size() && cells[end].first == cells[begin].first) ++end;
    if (end - begin > best_count) best = begin, best_count = end - begin;
  }
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t i = best; i < best + best_count; ++i) sum += votes[cells[i].second];
  return sum / static_cast<double>(best_count);
}

/// Mean shift: the mean of the votes around a place, until it stays.
Eigen::Vector3d settle(std::span<const Eigen::Vector3d> votes, Eigen::Vector3d place, double reach_mm) {
  for (int step = 0; step < 20; ++step) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double count = 0;
    for (const Eigen::Vector3d& vote : votes)
      if ((vote - place).norm() <= reach_mm) sum += vote, ++count;
    const Eigen::Vector3d next = sum / count;  // `place` is a mean of votes within a cell, so that some are near it
    const double moved = (next - place).norm();
    place = next;
    if (moved < 1e-3 * reach_mm) break;
  }
  return place;
}

/// Whether enough of the points around the sphere vote for its centre. Of a plane that touches it, a tenth does.
bool is_confirmed(std::span<const OrientedPoint> points, const Sphere& sphere) {
  std::size_t near = 0, agreeing = 0;
  for (const OrientedPoint& point : points) {
    if ((point.position - sphere.center).norm() > 1.2 * sphere.radius_mm) continue;
    const Eigen::Vector3d vote = point.position - sphere.radius_mm * point.normal;
    ++near;
    agreeing += (vote - sphere.center).norm() <= reach_share * sphere.radius_mm;
  }
  return agreeing >= fewest_votes && double(agreeing) >= fewest_votes_share * double(near);
}

std::optional<Sphere> find_one(std::span<const OrientedPoint> points, double radius_mm,
                               std::span<const Sphere> others) {
  std::vector<Eigen::Vector3d> votes;
  for (const OrientedPoint& point : points) {
    const Eigen::Vector3d vote = point.position - radius_mm * point.normal;
    const auto is_within = [&](const Sphere& other) { return (vote - other.center).norm() < other.radius_mm; };
    if (std::none_of(others.begin(), others.end(), is_within)) votes.push_back(vote);
  }
  if (votes.size() < fewest_votes) return std::nullopt;
  const Eigen::Vector3d place = fullest_place(votes, cell_share * radius_mm);
  const Sphere sphere{settle(votes, place, reach_share * radius_mm), radius_mm};
  return is_confirmed(points, sphere) ? std::optional(sphere) : std::nullopt;
}

}  // namespace

std::vector<Sphere> find_spheres(std::span<const OrientedPoint> points, std::span<const double> diameters_mm) {
  std::vector<Sphere> spheres;
  for (const double diameter : diameters_mm) {
    const auto sphere = find_one(points, 0.5 * diameter, spheres);
    if (!sphere) return {};
    spheres.push_back(*sphere);
  }
  if (spheres.size() == 2 && diameters_mm[0] == diameters_mm[1] && spheres[0].center.x() > spheres[1].center.x())
    std::swap(spheres[0], spheres[1]);
  return spheres;
}

}  // namespace pagesweep
