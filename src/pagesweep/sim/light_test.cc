// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "pagesweep/sim/bounce.h"
#include "pagesweep/sim/direct_light.h"

namespace pagesweep::sim {
namespace {

using std::numbers::pi;

const Stripe stripe(StripeShape::gaussian, 12, 0.5);

Surface make_surface(GridMesh mesh, float albedo) {
  return {.mesh = std::move(mesh), .albedo = Texture(albedo), .is_measured = true};
}

GridMesh face_down(GridMesh mesh) {
  for (Eigen::Vector3f& normal : mesh.normals.pixels()) normal = -normal;
  return mesh;
}

/// Every node gets light 1 at frame 3.
DirectLight even_light(const World& world) {
  DirectLight light;
  for (const Surface& surface : world.surfaces)
    light.emplace_back(surface.mesh.nodes(), NodeLight{.time = 3, .speed = 2, .diffuse = 1});
  return light;
}

// In a closed room with walls of albedo a that are lit with 1, a wall receives a from the others: form factors sum
// to 1.
TEST(Bounce, FillsAClosedRoom) {
  World world;
  world.surfaces.push_back(make_surface(face_down(make_sphere({0, 0, 50}, 40, 2)), 0.7f));
  const RayCaster caster = world.make_ray_caster();
  const Bounce bounce(world, caster, even_light(world), stripe, 8, {.spacing_mm = 20, .rays = 200});
  for (const float t : {20.0f, 50.0f, 90.0f}) EXPECT_NEAR(bounce.at(0, 60, t, 3), 0.7f, 1e-4f);
}

TEST(Bounce, NeverReturnsMoreThanItReceives) {
  World world;  // two plates that touch at their edges, like the pages at a gutter
  GridMesh left = make_rectangle({-50, -30, 0}, 50, 60, 2), right = make_rectangle({0, -30, 0}, 50, 60, 2);
  for (GridMesh* plate : {&left, &right}) {
    for (Eigen::Vector3d& point : plate->positions.pixels()) point.z() = std::abs(point.x());
    const float side = plate == &left ? 1.0f : -1.0f;
    for (Eigen::Vector3f& normal : plate->normals.pixels()) normal = Eigen::Vector3f(side, 0, 1).normalized();
  }
  world.surfaces.push_back(make_surface(std::move(left), 1));
  world.surfaces.push_back(make_surface(std::move(right), 1));
  const RayCaster caster = world.make_ray_caster();
  const Bounce bounce(world, caster, even_light(world), stripe, 8, {.spacing_mm = 5, .rays = 2000});
  for (float s = 0; s <= 50; s += 5) {
    const float glow = bounce.at(1, s, 30, 3);
    EXPECT_LE(glow, 1);
    EXPECT_GT(glow, 0);
  }
  // Between infinite plates at right angles the form factor at their common edge is (1 - cos 90) / 2.
  EXPECT_NEAR(bounce.at(1, 0, 30, 3), 0.5f, 0.02f);
}

/// Form factor from a small level face to a parallel a x b rectangle at distance c whose corner is above it.
double corner_form_factor(double a, double b, double c) {
  const double x = a / c, y = b / c, rx = std::hypot(1, x), ry = std::hypot(1, y);
  return (x / rx * std::atan(y / rx) + y / ry * std::atan(x / ry)) / (2 * pi);
}

TEST(Bounce, AgreesWithTheFormFactorOfFacingPlates) {
  World world;
  world.surfaces.push_back(make_surface(make_rectangle({-1, -1, 0}, 2, 2, 1), 0.5f));
  world.surfaces.push_back(make_surface(face_down(make_rectangle({-30, -20, 25}, 60, 40, 2)), 0.8f));
  const RayCaster caster = world.make_ray_caster();
  const Bounce bounce(world, caster, even_light(world), stripe, 8, {.spacing_mm = 1, .rays = 4000});
  EXPECT_NEAR(bounce.at(0, 1, 1, 3), 0.8 * 4 * corner_form_factor(30, 20, 25), 0.004);
}

TEST(CosineDirections, FollowLambertsLaw) {
  double cosines = 0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& direction : cosine_directions(1000)) {
    EXPECT_NEAR(direction.norm(), 1, 1e-12);
    cosines += direction.z() / 1000;
    sum += direction / 1000;
  }
  EXPECT_NEAR(cosines, 2.0 / 3, 1e-3);  // integral of cos^2 / pi
  EXPECT_LT(sum.head<2>().norm(), 2e-3);
}

const Lamp short_lamp(Light(TranslatingPlane{Eigen::Vector3d::UnitY(), -100, 1}), 500, 1);  // nearly a point

TEST(DirectLight, FollowsCosineAndDistance) {
  World world;
  GridMesh tilted = make_rectangle({-5, -5, 100}, 10, 10, 1);
  const double angle = 40 * pi / 180;
  for (Eigen::Vector3f& normal : tilted.normals.pixels())
    normal = Eigen::Vector3f(float(std::sin(angle)), 0, float(std::cos(angle)));
  world.surfaces.push_back(make_surface(std::move(tilted), 1));
  const RayCaster caster = world.make_ray_caster();
  const DirectLight light = light_surfaces(world, caster, short_lamp, {}, 4);
  const NodeLight middle = light_at(light[0], world.surfaces[0].mesh.spot_at(5, 5));
  EXPECT_NEAR(middle.diffuse, std::cos(angle) * std::pow(500.0 / 400, 2), 2e-3);
  EXPECT_NEAR(middle.time, 100, 1e-4);
  EXPECT_NEAR(middle.speed, 500.0 / 400, 1e-4);  // nearer to the bar the stripe is narrower, so it passes faster
}

TEST(DirectLight, DoesNotPassThroughPaper) {
  World world;
  world.surfaces.push_back(make_surface(make_rectangle({-50, -50, 0}, 100, 100, 5), 1));
  world.surfaces.push_back(make_surface(make_rectangle({-20, -20, 10}, 40, 40, 5), 1));
  const RayCaster caster = world.make_ray_caster();
  const DirectLight light = light_surfaces(world, caster, short_lamp, {}, 4);
  EXPECT_EQ(light_at(light[0], world.surfaces[0].mesh.spot_at(50, 50)).diffuse, 0);
  EXPECT_NEAR(light_at(light[0], world.surfaces[0].mesh.spot_at(90, 50)).diffuse, 1, 0.05);
}

// The lamp is upright above the spot: a viewer at 20 degrees from the vertical sees the mirror's direction at a normal
// that leans 10 degrees towards him.
TEST(DirectLight, MirrorsTowardsTheViewer) {
  const Eigen::Vector3d viewer(0, 500 * std::tan(20 * pi / 180), 500);
  const auto gloss_at = [&](double lean_deg) {
    World world;
    GridMesh face = make_rectangle({-5, -5, 0}, 10, 10, 1);
    const auto lean = float(lean_deg * pi / 180);
    for (Eigen::Vector3f& normal : face.normals.pixels()) normal = {0, std::sin(lean), std::cos(lean)};
    world.surfaces.push_back(make_surface(std::move(face), 1));
    world.surfaces[0].gloss = {.strength = 0.05, .exponent = 200};
    const RayCaster caster = world.make_ray_caster();
    return light_at(light_surfaces(world, caster, short_lamp, std::vector{viewer}, 4)[0], {{60, 61, 71}, {1, 0, 0}})
        .gloss[0];
  };
  EXPECT_NEAR(gloss_at(10), 0.05 * 208 / 8 * std::cos(10 * pi / 180), 0.02);
  EXPECT_LT(gloss_at(0), 0.1 * gloss_at(10));
}

TEST(Lamp, TurnsAboutItsBar) {
  RotatingPlane plane;
  plane.axis_point = {0, -20, 600};
  plane.angle0 = -0.3;
  plane.angle_per_frame = 0.003;
  const Lamp lamp(Light(plane), 0, 500);
  EXPECT_LT((lamp.middle_at(17) - plane.axis_point).norm(), 1e-12);
  EXPECT_NEAR(lamp.speed_at({10, 30, 0}), 0.003 * 600, 1e-9);
  EXPECT_NEAR(lamp.time_of({10, -20, 0}), 100, 1e-9);
}

}  // namespace
}  // namespace pagesweep::sim
