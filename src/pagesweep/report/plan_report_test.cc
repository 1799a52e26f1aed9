// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/report/plan_report.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "pagesweep/base/error.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

using testing::HasSubstr;
using testing::Not;

Plan plan_with(int cameras) {
  const Rig rig = sim::make_test_rig();
  PlanRequest request;
  request.cameras.assign(rig.cameras.begin(), rig.cameras.begin() + cameras);
  request.light = *rig.light;
  request.heights_mm = {0, 60};
  request.table = {600, 300, 0, 0};  // wider than the pictures
  request.grid_mm = 30;
  return make_plan(request);
}

TEST(PlanReport, SaysInTextAndJsonTheSame) {
  const Plan plan = plan_with(2);
  const std::string text = format_plan_text(plan);
  const auto json = nlohmann::json::parse(format_plan_json(plan, false));
  EXPECT_THAT(text, HasSubstr("photon noise"));
  EXPECT_THAT(text, HasSubstr("cameras twice as far apart"));
  EXPECT_EQ(json.at("format"), "pagesweep-plan");
  const double median = json.at("height_error_mm").at("median");
  EXPECT_NEAR(median, spread_of(plan.heights, plan.method(), true).median, 1e-4 * median * 10);
  EXPECT_EQ(json.at("heights").size(), 2u);
  EXPECT_FALSE(json.at("heights").at(0).contains("maps"));
  double shares = 0;
  for (const auto& share : json.at("time").at("share_of_variance")) shares += share.get<double>();
  EXPECT_NEAR(shares, 1, 1e-3);
}

TEST(PlanReport, MapsHaveNullWhereNothingIsSeen) {
  const auto json = nlohmann::json::parse(format_plan_json(plan_with(2), true));
  const auto& map = json.at("heights").at(0).at("maps").at("stereo");
  EXPECT_EQ(map.size(), 10u);
  EXPECT_EQ(map.at(5).size(), 20u);
  EXPECT_TRUE(map.at(5).at(0).is_null()) << "beside the pictures";
  EXPECT_TRUE(map.at(5).at(10).is_number());
}

TEST(PlanReport, OneCameraIsNotToldOfTwo) {
  const std::string text = format_plan_text(plan_with(1));
  EXPECT_THAT(text, Not(HasSubstr("two cameras")));
  EXPECT_THAT(text, HasSubstr("one camera and the sheet of light"));
}

TEST(PlanReport, WritesAPageThatNeedsNoOtherFile) {
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "plan_report_test";
  write_plan(folder, plan_with(2), "<rig>", "pagesweep test");
  const std::string html = read_bytes(folder / "plan.html", 1 << 24);
  EXPECT_THAT(html, HasSubstr("&lt;rig&gt;"));
  EXPECT_THAT(html, Not(HasSubstr("src=\"http")));
  EXPECT_THAT(html, HasSubstr("data:image/jpeg;base64,"));
  EXPECT_THAT(html, HasSubstr("</html>"));
  EXPECT_NO_THROW(nlohmann::json::parse(read_bytes(folder / "plan.json", 1 << 24)));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace pagesweep
