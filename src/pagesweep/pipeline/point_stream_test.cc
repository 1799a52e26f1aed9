// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/pipeline/point_stream.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

/// A curved page that the stripe sweeps over, two small cameras.
class FollowingTheStripe : public ::testing::Test {
 protected:
  const Rig rig = sim::make_test_rig(192);
  const sim::AnalyticScene scene{[](double x, double y) { return 25 + 12 * std::sin(0.02 * x) + 0.03 * y; }};
  const std::vector<RayTable> cameras{rig.cameras.begin(), rig.cameras.end()};
  const ScanOptions options;
  const PointStream::Steps steps{.corrects_edges = true, .fits_normals = true};
  std::vector<TimeMap> times;
  float first = std::numeric_limits<float>::infinity(), last = -first;

  FollowingTheStripe() {
    for (const Camera& camera : rig.cameras) {
      times.push_back(scene.times(camera, *rig.light));
      for (const float time : times.back().time.pixels()) {
        first = std::fmin(first, time);
        last = std::fmax(last, time);
      }
    }
  }

  /// What is known of the times when all before `until` are.
  std::vector<TimeMap> known(double until) const {
    std::vector<TimeMap> maps = times;
    for (TimeMap& map : maps)
      for (std::size_t i = 0; i < map.time.size(); ++i) {
        if (map.time.data()[i] < until) continue;
        map.time.data()[i] = map.sigma.data()[i] = map.amplitude.data()[i] = not_a_number;
        map.status.data()[i] = PixelStatus::not_computed;
      }
    return maps;
  }
  void follow(PointStream& points) const {
    for (float until = first; until < last + 8; until += 8) {
      const auto maps = known(until);
      points.follow({&maps[0], &maps[1]}, until);
    }
  }
  Measurement finish(PointStream& points) const {
    Measurement measurement;
    measurement.timing.emplace();
    measurement.timing->maps.resize(2);
    points.finish({&times[0], &times[1]}, measurement);
    return measurement;
  }
  Measurement at_once() const {
    PointStream points(cameras, options, steps);
    return finish(points);
  }
};

long long count_points(const PointMap& points) { return std::ranges::count(points.status.pixels(), PixelStatus::ok); }

/// Share of the pixels whose points of both maps lie within a tenth of their standard deviation, less than which adds
/// nothing to it, or that have none. The sheet of light is fitted to more points when all are there.
double share_alike(const PointMap& a, const PointMap& b) {
  long long alike = 0;
  for (std::size_t i = 0; i < a.x.size(); ++i) {
    const bool in_a = a.status.data()[i] == PixelStatus::ok, in_b = b.status.data()[i] == PixelStatus::ok;
    const float apart =
        std::hypot(a.x.data()[i] - b.x.data()[i], a.y.data()[i] - b.y.data()[i], a.z.data()[i] - b.z.data()[i]);
    alike += in_a == in_b && (!in_a || apart < 0.1f * a.sigma.data()[i]);
  }
  return static_cast<double>(alike) / static_cast<double>(a.x.size());
}

TEST_F(FollowingTheStripe, PartByPartGivesThePointsOfAllAtOnce) {
  PointStream points(cameras, options, steps);
  follow(points);
  const Measurement followed = finish(points), whole = at_once();
  ASSERT_TRUE(followed.sweep && whole.sweep);
  for (std::size_t c = 0; c < 2; ++c) {
    EXPECT_GT(count_points(whole.points[c]), 20000);
    // At the page's border a part may end where the whole goes on.
    EXPECT_GT(share_alike(followed.points[c], whole.points[c]), 0.999);
  }
}

TEST_F(FollowingTheStripe, MuchIsDoneBeforeTheEnd) {
  PointStream points(cameras, options, steps);
  follow(points);
  // The steps stay behind the stripe by some 60 of 192 pixels, and a part is up to 96 more.
  const long long so_far = count_points(points.so_far(0));
  EXPECT_GT(so_far, 0.3 * static_cast<double>(count_points(finish(points).points[0])));
}

TEST_F(FollowingTheStripe, TimesThatChangeLaterGoAllTheWayAgain) {
  const Measurement before = at_once();
  PointStream points(cameras, options, steps);
  follow(points);
  // Single spots, such as a glare that comes later: 0.4 % of the pixels.
  for (TimeMap& map : times)
    for (int y = 8; y < map.height(); y += 16)
      for (int x = 8; x < map.width(); x += 16) map.time(x, y) += 0.5f;
  const Measurement followed = finish(points), whole = at_once();
  EXPECT_GT(share_alike(followed.points[0], whole.points[0]), 0.999);
  ASSERT_LT(share_alike(whole.points[0], before.points[0]), 0.997) << "the spots would not be missed";
}

}  // namespace
}  // namespace pagesweep
