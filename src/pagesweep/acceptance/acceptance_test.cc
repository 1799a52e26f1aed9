// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/acceptance/acceptance.h"

#include <nlohmann/json.hpp>

#include "pagesweep/acceptance/artefact_scene_testing.h"
#include "pagesweep/io/files_testing.h"

namespace pagesweep {
namespace {

using testing::HasSubstr;
using testing::Not;

/// Two poses: flatness 0.3 and 0.2 mm, spacing error -0.03 and 0.01 mm; the second shows no spheres' form.
std::vector<PoseResult> two_poses() {
  std::vector<PoseResult> poses(2);
  for (std::size_t k = 0; k < 2; ++k) {
    poses[k].name = k == 0 ? "first <pose>" : "second";
    poses[k].plate.emplace();
    poses[k].plate->deviations.range_mm = k == 0 ? 0.3 : 0.2;
    poses[k].plate->map = Image<float>(18, 12, 0.01F);
    poses[k].spacing = SpacingResult{k == 0 ? 199.97 : 200.01, 200, 0.002};
  }
  return poses;
}

Artefact artefact() { return {"plate & spheres", Eigen::Vector2d(180, 120), {40, 40}, 200}; }

const QualityParameter& parameter(const Acceptance& acceptance, const std::string& name) {
  const auto has_name = [&](const QualityParameter& p) { return p.name == name; };
  return *std::find_if(acceptance.parameters.begin(), acceptance.parameters.end(), has_name);
}

TEST(JudgeAcceptance, TakesTheWorstOfAllPosesToBothSides) {
  const Acceptance acceptance = judge_acceptance(artefact(), two_poses(), {});
  EXPECT_EQ(parameter(acceptance, "flatness").worst(), 0.3);
  EXPECT_NEAR(parameter(acceptance, "sphere_spacing").worst(), -0.03, 1e-12);
  EXPECT_TRUE(std::isnan(parameter(acceptance, "probing_form").worst()));
  EXPECT_EQ(acceptance.verdict, AcceptanceVerdict::no_limits);
}

TEST(JudgeAcceptance, PassesOnlyIfEveryLimitIsKept) {
  const auto verdict = [](const AcceptanceLimits& limits) {
    return judge_acceptance(artefact(), two_poses(), limits).verdict;
  };
  EXPECT_EQ(verdict({.flatness_mm = 0.3}), AcceptanceVerdict::passed);
  EXPECT_EQ(verdict({.flatness_mm = 0.29}), AcceptanceVerdict::failed);
  EXPECT_EQ(verdict({.flatness_mm = 0.3, .sphere_spacing_mm = 0.031}), AcceptanceVerdict::passed);
  EXPECT_EQ(verdict({.flatness_mm = 0.3, .sphere_spacing_mm = 0.029}), AcceptanceVerdict::failed);
  EXPECT_THROW(verdict({.flatness_mm = -1}), std::invalid_argument);
}

TEST(JudgeAcceptance, FailsALimitOnWhatWasNotMeasured) {
  const Acceptance acceptance = judge_acceptance(artefact(), two_poses(), {.probing_form_mm = 1});
  EXPECT_EQ(acceptance.verdict, AcceptanceVerdict::failed);
  EXPECT_THAT(acceptance.headline, HasSubstr("probing error form limited, but nowhere measured"));
}

TEST(JudgeAcceptance, SaysHowManyPositionsTheGuidelineAsksFor) {
  const Acceptance acceptance = judge_acceptance(artefact(), two_poses(), {});
  EXPECT_THAT(acceptance.remarks, testing::Contains(HasSubstr("asks for 6 positions of the plate")));
}

TEST(WriteAcceptance, WritesOnePageAndItsFigures) {
  const test::TestFolder folder;
  const Acceptance acceptance = judge_acceptance(artefact(), two_poses(), {.sphere_spacing_mm = 0.02});
  write_acceptance(folder.path(), acceptance, {"pagesweep 1", {{"limits", "max-sphere-spacing", 0.02, "mm"}}});
  EXPECT_EQ(folder.files(), 2u);
  const auto json = nlohmann::json::parse(test::read_text(folder / "acceptance.json"));
  EXPECT_EQ(json["format"], "pagesweep-acceptance");
  EXPECT_EQ(json["verdict"], "failed");
  EXPECT_EQ(json["parameters"]["flatness"]["worst"], 0.3);
  EXPECT_EQ(json["parameters"]["sphere_spacing"]["kept"], false);
  EXPECT_TRUE(json["parameters"]["probing_form"]["worst"].is_null());
  EXPECT_EQ(json["options"]["limits"]["max-sphere-spacing"], 0.02);
  const std::string html = test::read_text(folder / "acceptance.html");
  EXPECT_THAT(html, HasSubstr("Failed: sphere spacing error"));
  EXPECT_THAT(html, HasSubstr("first &lt;pose&gt;"));
  EXPECT_THAT(html, HasSubstr("plate &amp; spheres"));
  for (const char* outside : {"http:", "https:", "<script", "<link"}) EXPECT_THAT(html, Not(HasSubstr(outside)));
}

TEST(FormatAcceptanceTable, NamesALimitThatIsExceeded) {
  const Acceptance acceptance = judge_acceptance(artefact(), two_poses(), {.sphere_spacing_mm = 0.02});
  const std::string table = format_acceptance_table(acceptance);
  EXPECT_THAT(table, HasSubstr("-0.0300 mm  limit 0.02 mm EXCEEDED"));
  EXPECT_THAT(table, HasSubstr("F  flatness measurement error"));
}

}  // namespace
}  // namespace pagesweep
