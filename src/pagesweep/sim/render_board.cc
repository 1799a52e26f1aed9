// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/render_board.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "pagesweep/base/parallel.h"
#include "pagesweep/sim/random.h"
#include "pagesweep/sim/render_camera.h"
#include "pagesweep/sim/world.h"

namespace pagesweep::sim {
namespace {

/// Adds the part of a row of texels that a rectangle's extent [low, high) covers.
void cover(double low, double high, int count, const std::function<void(int, double)>& add) {
  const int begin = std::max(0, static_cast<int>(std::floor(low)));
  const int end = std::min(count, static_cast<int>(std::ceil(high)));
  for (int i = begin; i < end; ++i) add(i, std::min(high, i + 1.0) - std::max(low, double(i)));
}

void ink_disc(const BoardDrawing::Disc& disc, double border, double texels_per_mm, Image<float>& ink) {
  constexpr int parts = 8;
  const double x = (disc.x_mm + border) * texels_per_mm, y = (disc.y_mm + border) * texels_per_mm;
  const double radius = disc.radius_mm * texels_per_mm;
  cover(y - radius, y + radius, ink.height(), [&](int j, double) {
    cover(x - radius, x + radius, ink.width(), [&](int i, double) {
      int inside = 0;
      for (int k = 0; k < parts * parts; ++k)
        inside += std::hypot(i + (k % parts + 0.5) / parts - x, j + (k / parts + 0.5) / parts - y) < radius;
      ink(i, j) += static_cast<float>(inside) / (parts * parts);
    });
  });
}

/// The board with its white border: texel rows count along the board's y axis. A texel has its ink's exact share.
Image<float> print_texels(const BoardDrawing& drawing, double border, const BoardRenderOptions& options) {
  const double scale = options.texels_per_mm;
  Image<float> ink(static_cast<int>(std::ceil((drawing.width_mm + 2 * border) * scale)),
                   static_cast<int>(std::ceil((drawing.height_mm + 2 * border) * scale)));
  for (const auto& r : drawing.rectangles)
    cover((r.y_mm + border) * scale, (r.y_mm + r.height_mm + border) * scale, ink.height(), [&](int j, double down) {
      cover((r.x_mm + border) * scale, (r.x_mm + r.width_mm + border) * scale, ink.width(),
            [&](int i, double across) { ink(i, j) += static_cast<float>(down * across); });
    });
  for (const auto& disc : drawing.discs) ink_disc(disc, border, scale, ink);
  for (float& value : ink.pixels())
    value = static_cast<float>(options.white + (options.black - options.white) * std::min(1.0, double(value)));
  return ink;
}

GridMesh make_board_mesh(const PlacedBoard& board, double border_mm) {
  const double spacing_mm = board.bend_mm ? 2 : 20;
  GridMesh mesh(even_lines(board.drawing->width_mm + 2 * border_mm, spacing_mm),
                even_lines(board.drawing->height_mm + 2 * border_mm, spacing_mm));
  for (int j = 0; j < mesh.rows(); ++j)
    for (int i = 0; i < mesh.columns(); ++i) {
      const double x = (mesh.s[std::size_t(i)] - border_mm) * board.print_scale.x();
      const double y = (mesh.t[std::size_t(j)] - border_mm) * board.print_scale.y();
      const double z = board.bend_mm ? board.bend_mm(x, y) : 0;
      mesh.positions(i, j) = board.rig_from_board * Eigen::Vector3d(x, y, z);
      mesh.normals(i, j) = board.rig_from_board.rotation.col(2).cast<float>();
    }
  return mesh;
}

World build_world(const PlacedBoard& board, const BoardRenderOptions& options) {
  double border_mm = options.border_mm;
  for (const auto& disc : board.drawing->discs) border_mm = std::max(border_mm, options.border_mm + disc.radius_mm);
  World world;
  world.surfaces.push_back({.mesh = make_rectangle({-600, -600, -0.2}, 1200, 1200, 100),
                            .albedo = Texture(static_cast<float>(options.table))});
  world.surfaces.push_back({.mesh = make_board_mesh(board, border_mm),
                            .albedo = Texture(print_texels(*board.drawing, border_mm, options), options.texels_per_mm),
                            .is_measured = true});
  return world;
}

/// Viewing rays at the corners of a grid of cells; within a cell they are interpolated, which is exact to 3e-4 px.
class RayGrid {
 public:
  explicit RayGrid(const Scanner& sensor)
      : columns_((sensor.width() + 2 * cell - 1) / cell + 1), rows_((sensor.height() + 2 * cell - 1) / cell + 1) {
    rays_.resize(std::size_t(columns_) * std::size_t(rows_));
    parallel_rows(rows_, [&](int j) {
      for (int i = 0; i < columns_; ++i) rays_[index(i, j)] = sensor.ray(Eigen::Vector2d(i * cell - 4, j * cell - 4));
    });
  }

  std::optional<SimRay> at(double u, double v) const {
    const double x = (u + 4) / cell, y = (v + 4) / cell;
    const int i = std::clamp(static_cast<int>(x), 0, columns_ - 2), j = std::clamp(static_cast<int>(y), 0, rows_ - 2);
    const double a = x - i, b = y - j;
    SimRay ray{Eigen::Vector3f::Zero(), Eigen::Vector3f::Zero()};
    Eigen::Vector3d origin = Eigen::Vector3d::Zero(), direction = Eigen::Vector3d::Zero();
    for (int k = 0; k < 4; ++k) {
      const auto& corner = rays_[index(i + k % 2, j + k / 2)];
      if (!corner) return std::nullopt;
      const double weight = (k % 2 ? a : 1 - a) * (k / 2 ? b : 1 - b);
      origin += weight * corner->origin;
      direction += weight * corner->direction;
    }
    ray.origin = origin.cast<float>();
    ray.direction = direction.cast<float>();
    return ray;
  }

 private:
  static constexpr int cell = 4;  // [px]
  std::size_t index(int i, int j) const { return std::size_t(j) * std::size_t(columns_) + std::size_t(i); }
  int columns_, rows_;
  std::vector<std::optional<Ray>> rays_;
};

class BoardRenderer {
 public:
  BoardRenderer(const World& world, const RayCaster& caster, const Scanner& sensor, const BoardRenderOptions& options)
      : world_(world),
        caster_(caster),
        grid_(sensor),
        offsets_(spot_offsets(options.rays_per_side, options.psf_sigma_px)),
        table_(static_cast<float>(options.table)) {
    // Texels larger than the distance of samples, so that these do not alias; each has its ink's exact share.
    const Eigen::Vector3d middle = world.surfaces[board_surface].mesh.point(world.surfaces[board_surface].mesh.spot_at(
        0.5 * world.surfaces[board_surface].mesh.s.back(), 0.5 * world.surfaces[board_surface].mesh.t.back()));
    if (!sensor.project(middle)) return;
    const double mm_per_px = 1 / sensor.project_jacobian(middle).row(0).norm();
    const double spot_px = std::sqrt(1.0 / 12 + options.psf_sigma_px * options.psf_sigma_px);
    level_ = world.surfaces[board_surface].albedo.level_for(4 * spot_px * mm_per_px / options.rays_per_side);
  }

  /// What rays through the upper corners of a row's pixels meet; one more than there are pixels.
  std::vector<SimHit> corner_hits(int width, double y) const {
    std::vector<SimRay> rays;
    std::vector<SimHit> hits(std::size_t(width) + 1);
    for (int x = 0; x <= width; ++x)
      rays.push_back(grid_.at(x - 0.5, y).value_or(SimRay{Eigen::Vector3f::Zero(), Eigen::Vector3f::UnitZ()}));
    caster_.cast(rays, hits);
    return hits;
  }

  /// Mean albedo of the spot that a pixel sees.
  double albedo(int x, int y, const SimHit& upper_left, const SimHit& upper_right, const SimHit& lower_left,
                const SimHit& lower_right) const {
    const int surface = upper_left.surface;
    for (const SimHit* hit : {&upper_right, &lower_left, &lower_right})
      if (hit->surface != surface) return albedo_by_rays(x, y);
    if (surface != board_surface) return surface < 0 ? 0 : double(table_);
    // Within a pixel, places on the board change linearly.
    const auto& mesh = world_.surfaces[board_surface].mesh;
    const Eigen::Vector2f a = mesh.parameters(upper_left.spot), b = mesh.parameters(upper_right.spot),
                          c = mesh.parameters(lower_left.spot), d = mesh.parameters(lower_right.spot);
    const Eigen::Vector2f middle = 0.25f * (a + b + c + d), by_x = 0.5f * (b + d - a - c),
                          by_y = 0.5f * (c + d - a - b);
    double sum = 0;
    for (const double dy : offsets_)
      for (const double dx : offsets_) {
        const Eigen::Vector2f st = middle + static_cast<float>(dx) * by_x + static_cast<float>(dy) * by_y;
        sum += double(world_.surfaces[board_surface].albedo.at(st.x(), st.y(), level_));
      }
    return sum / double(offsets_.size() * offsets_.size());
  }

 private:
  /// Where a pixel sees the table, or the board's end.
  double albedo_by_rays(int x, int y) const {
    double sum = 0;
    for (const double dy : offsets_)
      for (const double dx : offsets_) {
        const auto ray = grid_.at(x + dx, y + dy);
        const SimHit hit = ray ? caster_.cast(*ray) : SimHit{};
        if (hit.surface == board_surface) {
          const Eigen::Vector2f st = world_.surfaces[board_surface].mesh.parameters(hit.spot);
          sum += double(world_.surfaces[board_surface].albedo.at(st.x(), st.y(), level_));
        } else if (hit.surface >= 0) {
          sum += double(table_);
        }
      }
    return sum / double(offsets_.size() * offsets_.size());
  }

  static constexpr int board_surface = 1;
  const World& world_;
  const RayCaster& caster_;
  RayGrid grid_;
  std::vector<double> offsets_;
  float table_;
  int level_ = 0;
};

}  // namespace

Image<std::uint8_t> render_board(const PlacedBoard& board, const Scanner& sensor, const BoardRenderOptions& options,
                                 std::uint64_t seed) {
  const World world = build_world(board, options);
  const RayCaster caster = world.make_ray_caster();
  const BoardRenderer renderer(world, caster, sensor, options);
  const CounterRandom noise(seed, 0xB0A2D);
  const int width = sensor.width(), height = sensor.height();
  Image<std::uint8_t> picture(width, height);
  parallel_rows(height, [&](int y) {
    const auto upper = renderer.corner_hits(width, y - 0.5), lower = renderer.corner_hits(width, y + 0.5);
    for (int x = 0; x < width; ++x) {
      const auto i = std::size_t(x);
      const double albedo = renderer.albedo(x, y, upper[i], upper[i + 1], lower[i], lower[i + 1]);
      const double radius = std::hypot(x - 0.5 * width, y - 0.5 * height) / (0.5 * std::hypot(width, height));
      const double light = options.exposure / options.white * (1 - options.falloff * radius * radius) * albedo;
      const auto address = std::uint64_t(y) * std::uint64_t(width) + std::uint64_t(x);
      picture(x, y) = static_cast<std::uint8_t>(expose(options.sensor, light, noise, address));
    }
  });
  return picture;
}

std::vector<Rigid3> board_poses(const Eigen::Vector2d& size_mm, const Eigen::Vector2d& table_mm, double highest_mm,
                                int count, std::uint64_t seed) {
  const CounterRandom random(seed, 0x905E5);
  std::uint64_t drawn = 0;
  const auto between = [&](double low, double high) { return low + (high - low) * random.uniform(drawn++); };
  constexpr double degree = std::numbers::pi / 180;
  const auto middle = Eigen::Vector3d(0.5 * size_mm.x(), 0.5 * size_mm.y(), 0);
  std::vector<Rigid3> poses;
  for (int k = 0; k < count; ++k) {
    // Directions of tilt follow each other by the golden angle, so that any number of poses covers all of them.
    const double direction = k * 2.399963, tilt = k == 0 ? 0 : between(8, 30) * degree;
    const double turn = k == 0 ? 0 : between(-30, 30) * degree;
    const Eigen::Vector3d axis(std::cos(direction), std::sin(direction), 0);
    Rigid3 pose;
    pose.rotation =
        (Eigen::AngleAxisd(tilt, axis) * Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ())).toRotationMatrix();
    double lowest = 0;  // of the board's ends, relative to its middle
    for (const double sx : {-1.0, 1.0})
      for (const double sy : {-1.0, 1.0})
        lowest = std::min(lowest, (pose.rotation * Eigen::Vector3d(sx * middle.x(), sy * middle.y(), 0)).z());
    const Eigen::Vector3d place =
        k == 0 ? Eigen::Vector3d::Zero()
               : Eigen::Vector3d(between(-0.5, 0.5) * table_mm.x(), between(-0.5, 0.5) * table_mm.y(),
                                 -lowest + 1 + between(0, highest_mm));
    pose.translation = place - pose.rotation * middle;
    poses.push_back(pose);
  }
  return poses;
}

}  // namespace pagesweep::sim
