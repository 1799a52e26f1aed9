// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/simulate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "pagesweep/base/parallel.h"

namespace pagesweep::sim {
namespace {

constexpr double degree = std::numbers::pi / 180;

/// A small bent sheet under cameras and a scanner of full resolution that see no more than it.
Scene make_small_scene() {
  Scene scene;
  scene.rig = make_default_rig();
  for (Camera& camera : scene.rig.cameras) {
    const Eigen::Vector2d middle = *camera.project({0, 0, 4});
    camera.width = camera.height = 72;
    camera.cx += std::round(36 - middle.x());
    camera.cy += std::round(36 - middle.y());
  }
  Pushbroom line = std::get<Pushbroom>(scene.rig.scanner->model());
  line.width = 480, line.height = 400;
  line.cx = 239.5;
  line.center.y() = 199.5 * 25.4 / 300;
  scene.rig.scanner = Scanner(line);
  scene.lamp.light = Light(TranslatingPlane{Eigen::Vector3d::UnitY(), -40, 1.7});
  scene.camera.frames = 48;
  scene.quality.bounce = {.spacing_mm = 5, .rays = 64};

  ScenePage page;
  page.shape.width_mm = page.print.width_mm = 60;
  page.shape.height_mm = page.print.height_mm = 60;
  page.shape.at_mm = {-29, 0, 3};
  page.shape.slopes = {{0, 30 * degree}, {25, 5 * degree}, {60, -12 * degree}};
  scene.pages.push_back(page);
  return scene;
}

void make_noise_free(Scene& scene) {
  scene.sensor.bit_depth = 16;
  scene.sensor.black_level = 0;
  scene.sensor.noisy = false;
}

void print_dense_text(ScenePage& page) {
  page.print.texts = {std::string(
      "Reading depends on this difference and on nothing else: the edge of a letter is the place where paper turns "
      "into "
      "ink. Light and dark, light and dark, line after line, as dense as the smallest print that can be read at all.")};
  page.print.font_size_pt = 9;
  page.print.line_spacing = 1;
  page.print.margin_left_mm = page.print.margin_right_mm = page.print.margin_top_mm = page.print.margin_bottom_mm = 6;
}

/// Centre of mass of a pixel's bell: without noise and with the whole bell in view it is the centre of a symmetric one.
struct Bell {
  double time;
  double light;  ///< sum over the frames, background removed
};
Bell bell_of(const Frames& frames, int x, int y) {
  std::vector<double> gray;
  for (int i = 0; i < frames.count(); ++i) gray.push_back(std::get<Image<std::uint16_t>>(frames.frame(i))(x, y));
  const double background = *std::ranges::min_element(gray);
  Bell bell{0, 0};
  for (std::size_t i = 0; i < gray.size(); ++i) {
    bell.light += gray[i] - background;
    bell.time += double(i) * (gray[i] - background);
  }
  bell.time /= bell.light;
  return bell;
}

TEST(Simulate, FramesTakeTurnsWithTheirExposures) {
  Scene scene = make_small_scene();
  make_noise_free(scene);
  const Frames once = simulate(scene, {}).frames[0];
  scene.camera.exposures = {0.25, 1};
  const Frames frames = simulate(scene, {}).frames[0];
  EXPECT_EQ(frames.sequence().exposure(0), 0.25);
  EXPECT_EQ(frames.sequence().exposure(1), 1);
  Image<float> all_long, mixed;
  once.read_row(36, all_long);
  frames.read_row(36, mixed);
  for (int i = 0; i < frames.count(); ++i) {
    EXPECT_NEAR(mixed(36, i), all_long(36, i), 3) << "four times half a gray value, and half a one";
    const auto& shown = std::get<Image<std::uint16_t>>(frames.frame(i));
    EXPECT_NEAR(shown(36, 36), all_long(36, i) * (i % 2 == 0 ? 0.25 : 1), 1);
  }
}

bool is_inside_page(const Image<Eigen::Vector3f>& points, int x, int y, int margin_px) {
  for (int j = y - margin_px; j <= y + margin_px; ++j)
    for (int i = x - margin_px; i <= x + margin_px; ++i)
      if (!points.contains(i, j) || !std::isfinite(points(i, j).z())) return false;
  return true;
}

// Both cameras are compared with the geometric sheet of light at what they see, hence also with each other. The bound
// is the design's: a tenth of what noise does to a good time value.
TEST(Simulate, BlankPaperIsBrightWhenTheSheetOfLightPasses) {
  Scene scene = make_small_scene();
  make_noise_free(scene);
  for (const StripeShape shape : {StripeShape::gaussian, StripeShape::flat_top}) {
    scene.lamp.shape = shape;
    const Simulation simulation = simulate(scene, {});
    for (std::size_t k = 0; k < 2; ++k) {
      int compared = 0;
      for (int y = 0; y < 72; ++y)
        for (int x = 0; x < 72; ++x) {
          if (!is_inside_page(simulation.camera_points[k], x, y, 3)) continue;
          const auto point = simulation.camera_points[k](x, y).cast<double>();
          EXPECT_NEAR(bell_of(simulation.frames[k], x, y).time, *simulation.rig.light->time_of(point), 0.01);
          ++compared;
        }
      EXPECT_GT(compared, 3000);
    }
  }
}

// Twice as many rays, 11 x 11 for 8 x 8. Noise moves the times of text by 0.02 frames and more.
TEST(Simulate, MoreRaysDoNotMoveTheTimesOfText) {
  Scene scene = make_small_scene();
  make_noise_free(scene);
  print_dense_text(scene.pages[0]);
  scene.rig.scanner.reset();
  scene.rig.cameras.resize(1);
  scene.rig.cameras[0].height = 48;
  const Simulation usual = simulate(scene, {});
  scene.camera.rays_per_side = 11;
  const Simulation twice = simulate(scene, {});
  double squares = 0;
  int compared = 0;
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 72; ++x) {
      if (!is_inside_page(usual.camera_points[0], x, y, 3)) continue;
      const double shift = bell_of(usual.frames[0], x, y).time - bell_of(twice.frames[0], x, y).time;
      EXPECT_LT(std::abs(shift), 0.006);
      squares += shift * shift;
      ++compared;
    }
  ASSERT_GT(compared, 1500);
  EXPECT_LT(std::sqrt(squares / compared), 0.0015);
}

TEST(Simulate, DoesNotDependOnTheNumberOfThreads) {
  Scene scene = make_small_scene();
  print_dense_text(scene.pages[0]);
  const auto run = [&](int threads, int seed) {
    const ThreadLimit limit(threads);
    return simulate(scene, {.preview = false, .seed = seed});
  };
  const Simulation one = run(1, 7), two = run(2, 7), other = run(2, 8);
  const auto same = [](const auto& a, const auto& b) { return std::ranges::equal(a.pixels(), b.pixels()); };
  const auto gray = [](const Simulation& simulation, int i) {
    return std::get<Image<std::uint8_t>>(simulation.frames[1].frame(i));
  };
  for (int i = 0; i < scene.camera.frames; ++i) EXPECT_TRUE(same(gray(one, i), gray(two, i))) << i;
  EXPECT_TRUE(std::ranges::equal(std::get<0>(one.scan.samples).pixels(), std::get<0>(two.scan.samples).pixels()));
  EXPECT_FALSE(same(gray(one, 20), gray(other, 20)));
}

/// All three models, each over the small sheet.
std::vector<Scanner> small_scanners() {
  const Pushbroom line = std::get<Pushbroom>(make_small_scene().rig.scanner->model());
  Camera camera;
  camera.width = line.width, camera.height = line.height;
  camera.fx = camera.fy = line.f;
  camera.cx = line.cx, camera.cy = 199.5;
  camera.distortion.k1 = -0.05;
  camera.cam_from_rig = {line.rotation, -(line.rotation * Eigen::Vector3d(0, 0, 700))};
  RotatingLine turning;
  turning.width = line.width, turning.height = line.height;
  turning.f = line.f, turning.cx = line.cx;
  turning.rotation = line.rotation;
  turning.center = {0, 0, 700};
  turning.angle_step = 1 / line.f;
  turning.angle0 = -199.5 * turning.angle_step;
  return {Scanner(line), Scanner(camera), Scanner(turning)};
}

TEST(Simulate, FindsEverySpotOfPaperInTheScan) {
  Scene scene = make_small_scene();
  scene.pages[0].print.figures = {{FigureKind::photo, 12, 16, 36, 26}};
  scene.quality.points_subsampling = 8;
  for (Camera& camera : scene.rig.cameras) camera.width = camera.height = 16;
  for (const Scanner& scanner : small_scanners()) {
    scene.rig.scanner = scanner;
    const Simulation simulation = simulate(scene, {});
    const SimulatedPage& page = simulation.pages[0];
    const auto& scan = std::get<Image<std::uint8_t>>(simulation.scan.samples);
    int seen = 0;
    double squares = 0;
    for (int j = 0; j < page.points.height(); ++j)
      for (int i = 0; i < page.points.width(); ++i) {
        const double u = page.scan_map.u(8 * i, 8 * j), v = page.scan_map.v(8 * i, 8 * j);
        const auto pixel = scanner.project(page.points(i, j).cast<double>());
        if (!std::isfinite(u)) continue;
        EXPECT_LT((*pixel - Eigen::Vector2d(u, v)).norm(), 2e-3);
        const int x = int(std::lround(u)), y = int(std::lround(v));
        if (!scan.contains(3 * x, y)) continue;
        const double printed = 255 * encode_srgb(page.albedo(8 * i, 8 * j));
        squares += std::pow(scan(3 * x, y) - printed, 2);
        ++seen;
      }
    ASSERT_GT(seen, 1000);
    // Slopes to 30 degrees dim the paper by up to 14 %, in sRGB 7 % of 237.
    EXPECT_LT(std::sqrt(squares / seen), 17) << scanner.model().index();
  }
}

TEST(Simulate, RefusesASceneThatContradictsItself) {
  Scene scene = make_small_scene();
  scene.rig.cameras.clear();
  EXPECT_THROW(simulate(scene, {}), std::invalid_argument);
}

}  // namespace
}  // namespace pagesweep::sim
