// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/report/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <random>

#include "pagesweep/base/error.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/report/html.h"
#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

/// A page of gray "text lines" of that size.
Picture printed_page(int width, int height, double pixels_per_mm) {
  Picture picture = make_picture(width, height, 3, 8);
  picture.pixels_per_mm = pixels_per_mm;
  auto& bytes = std::get<Image<std::uint8_t>>(picture.samples);
  std::mt19937 random(7);
  const int line = std::max(8, static_cast<int>(6 * pixels_per_mm));
  Image<std::uint8_t> words(width / 5 + 1, height / line + 1);
  for (auto& word : words.pixels()) word = random() % 5 == 0;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const bool in_margin = x < width / 9 || x > width * 8 / 9 || y < height / 10 || y > height * 9 / 10;
      const bool inked = !in_margin && y % line < line / 3 && !words(x / 5, y / line) && (x * 7 + y * 3) % 11 < 6;
      const int paper = 238 - 18 * std::abs(x - width / 2) / width;
      bytes(3 * x, y) = static_cast<std::uint8_t>(inked ? 40 : paper);
      bytes(3 * x + 1, y) = static_cast<std::uint8_t>(inked ? 38 : paper - 4);
      bytes(3 * x + 2, y) = static_cast<std::uint8_t>(inked ? 42 : paper - 16);
    }
  return picture;
}

/// An open book as a run would report it: everything there is, with noise and gaps.
struct Book {
  sim::AnalyticScene scene{.height = [](double x, double y) {
    if (std::abs(x) > 190 || std::abs(y) > 130) return std::abs(x) < 215 && std::abs(y) < 155 ? 0.0 : NAN;
    return 4 + 30 * std::exp(-std::abs(x) / 60) * (1 - std::exp(-std::abs(x) / 14)) +
           1.2 * std::exp(-(std::pow(x - 90, 2) + std::pow(y + 20, 2)) / 300);
  }};
  Rig rig;
  std::vector<TimeMap> times;
  std::vector<PointMap> points;
  std::vector<PageSurface> surfaces;
  std::vector<Page> pages;
  Picture scan;
  ReportInputs inputs;

  explicit Book(int camera_px = 64, int page_px = 90) : rig(sim::make_test_rig(camera_px)) {
    measure();
    scan = printed_page(2 * page_px, page_px * 3 / 2, page_px / 190.0);
    for (int index = 1; index <= 2; ++index) add_page(index, page_px);
    inputs.title = "spread";
    inputs.program = "pagesweep 0.1.0";
    for (std::size_t c = 0; c < 2; ++c)
      inputs.cameras.push_back({rig.cameras[c].name, 200, 0, &times[c], &points[c], {}});
    for (double t = -8; t <= 8; t += 0.25) inputs.profile.push_back({t, std::exp(-t * t / 18)});
    inputs.surfaces = surfaces;
    inputs.pages = pages;
    inputs.scan = &scan;
    inputs.figures = {{"stripe", "fwhm", "width of the stripe at half height", 7.06, "frames", ""},
                      {"stripe", "speed", "speed of the stripe", NAN, "mm/frame", "the rig does not tell"}};
    inputs.options = {{"timing", "estimator", std::string("refined"), ""},
                      {"timing", "min-amplitude", 8.0, "gray values"}};
    inputs.times = {{"time values", 3.2}, {"matches", 1.4}, {"pages", 5.1}};
  }

  void measure() {
    std::mt19937 random(3);
    std::normal_distribution<float> noise;
    for (const Camera& camera : rig.cameras) {
      TimeMap& time = times.emplace_back(scene.times(camera, *rig.light));
      PointMap& point = points.emplace_back(scene.points(camera));
      for (int y = 0; y < camera.height; ++y)
        for (int x = 0; x < camera.width; ++x) {
          if (point.status(x, y) != PixelStatus::ok) continue;
          const double row = std::fmod(point.y(x, y) + 500.0, 6.0);
          const bool print = row < 2.4 && std::abs(std::abs(point.x(x, y)) - 95) < 75 && std::abs(point.y(x, y)) < 110;
          time.amplitude(x, y) = print ? 60.f : 170.f;
          point.sigma(x, y) = print ? 0.12f : 0.05f;
          point.z(x, y) += point.sigma(x, y) * noise(random);
          const auto lose = [&](PixelStatus why) {
            point.status(x, y) = why;
            point.x(x, y) = point.y(x, y) = point.z(x, y) = point.sigma(x, y) = not_a_number;
          };
          if (std::hypot(point.x(x, y) + 120, point.y(x, y) - 60) < 9) lose(PixelStatus::saturated);
          if (std::abs(point.x(x, y)) < 1.5) lose(PixelStatus::no_match);
        }
    }
  }
  void add_page(int index, int page_px) {
    Page page;
    page.index = index;
    page.picture = printed_page(page_px, page_px * 3 / 2, page_px / 190.0);
    page.measured_share = 0.984;
    page.deskew_rad = 0.004;
    page.scan_map = ScanMap(page_px, page_px * 3 / 2);
    for (int y = 0; y < page.scan_map.height(); ++y)
      for (int x = 0; x < page_px; ++x) {
        page.scan_map.u(x, y) = static_cast<float>((index - 1) * page_px + x);
        page.scan_map.v(x, y) = static_cast<float>(y);
      }
    pages.push_back(std::move(page));
    PageSurface surface;
    surface.index = index;
    surface.model_name = "cylinder";
    surface.model = surface.measured = Image<Eigen::Vector3f>(96, 130);
    surface.status = Image<PixelStatus>(96, 130, PixelStatus::ok);
    surface.strain = surface.strain_sigma = Image<float>(96, 130, 1e-4f);
    surface.strain(30, 70) = 3e-3f;
    for (int j = 0; j < 130; ++j)
      for (int i = 0; i < 96; ++i) {
        const float dent = 0.8f * std::exp(-std::hypot(static_cast<float>(i) - 30, static_cast<float>(j) - 70) / 8);
        surface.model(i, j) = {2 * static_cast<float>(i), -2 * static_cast<float>(j), 0};
        surface.measured(i, j) = surface.model(i, j) + Eigen::Vector3f(0, 0, dent);
      }
    surfaces.push_back(std::move(surface));
  }
};

class ReportTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(testing::TempDir()) / (std::string("pagesweep_report_") + test->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string html() const { return read_bytes(folder_ / "report.html", 1 << 26); }
  nlohmann::json json() const { return nlohmann::json::parse(read_bytes(folder_ / "report.json", 1 << 26)); }

  fs::path folder_;
};

TEST_F(ReportTest, TellsWhereTheSheetSeemsStretched) {
  const Book book;
  write_report(folder_, book.inputs);
  const auto page = json()["pages"][0];
  EXPECT_NEAR(page["strain_rms"].get<double>(), 1e-4, 2e-5);
  EXPECT_NEAR(page["unexplained_strain_share"].get<double>(), 1.0 / (96 * 130), 1e-9);
  EXPECT_EQ(page["covered_share"].get<double>(), 0);
  EXPECT_THAT(html(), HasSubstr("Paper does not stretch"));
}

TEST_F(ReportTest, IsOneSelfContainedPageAndLeavesNothingElse) {
  const Book book;
  write_report(folder_, book.inputs);
  const std::string page = html();
  EXPECT_THAT(page, HasSubstr("Both pages measured: 98.4 % of the paper"));
  EXPECT_THAT(page, Not(HasSubstr("http"))) << "nothing is fetched";
  EXPECT_THAT(page, HasSubstr("prefers-color-scheme"));
  EXPECT_LT(page.size(), 6'000'000u);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 2);
  for (const char* tag : {"section", "figure", "table", "div", "p", "span", "b"}) {
    const auto count = [&](const std::string& text) {
      std::size_t n = 0;
      for (std::size_t at = page.find(text); at != std::string::npos; at = page.find(text, at + 1)) ++n;
      return n;
    };
    const std::string name = tag;
    EXPECT_EQ(count("<" + name + ">") + count("<" + name + " "), count("</" + name + ">")) << tag;
  }
}

TEST_F(ReportTest, JsonTellsTheSame) {
  const Book book;
  write_report(folder_, book.inputs);
  const auto report = json();
  EXPECT_EQ(report["format"], "pagesweep-report");
  EXPECT_EQ(report["verdict"]["level"], "good");
  EXPECT_EQ(report["cameras"][0]["points"]["ok"],
            count_status(book.points[0].status)[static_cast<std::size_t>(PixelStatus::ok)]);
  EXPECT_NEAR(report["pages"][0]["width_mm"].get<double>(), 190, 1e-9);
  EXPECT_EQ(report["pages"][1]["model"], "cylinder");
  EXPECT_EQ(report["options"]["timing"]["estimator"], "refined");
  EXPECT_TRUE(report["figures"]["stripe"]["speed"]["value"].is_null());
  EXPECT_EQ(report["figures"]["stripe"]["speed"]["reason"], "the rig does not tell");
}

TEST_F(ReportTest, TellsHowEachCameraWasExposed) {
  Book book;
  write_report(folder_, book.inputs);
  EXPECT_FALSE(json()["cameras"][1].contains("exposure"));
  book.inputs.cameras[1].exposure = "take <less> of the light";
  write_report(folder_, book.inputs);
  EXPECT_EQ(json()["cameras"][1]["exposure"], "take <less> of the light");
  EXPECT_THAT(html(), HasSubstr("<li>" + book.rig.cameras[1].name + ": take &lt;less&gt; of the light.</li>"));
}

TEST_F(ReportTest, TellsEachPagesQualityAndItsVerdict) {
  Book book;
  std::vector<PageQuality> quality(2);
  quality[1].index = 2;
  quality[1].verdict = PageVerdict::scan_again;
  quality[1].reasons = {"print is blurred along the lines"};
  quality[1].figures = {{{"page_2", "noise", "of blank paper", 1.7, "L*", ""}, "3 stars", "B"},
                        {{"page_2", "mtf10_across", "a tenth", NAN, "lines/mm", "no edges"}, "", ""}};
  book.inputs.quality = quality;
  write_report(folder_, book.inputs);
  const auto page = json()["pages"][1]["quality"];
  EXPECT_EQ(page["verdict"], "scan_again");
  EXPECT_EQ(page["reasons"][0], "print is blurred along the lines");
  EXPECT_EQ(page["figures"]["noise"]["fadgi"], "3 stars");
  EXPECT_EQ(page["figures"]["noise"]["iso_19264"], "B");
  EXPECT_TRUE(page["figures"]["mtf10_across"]["value"].is_null());
  EXPECT_EQ(page["figures"]["mtf10_across"]["reason"], "no edges");
  EXPECT_EQ(judge(book.inputs).level, VerdictLevel::scan_again);
  EXPECT_THAT(judge(book.inputs).remarks.at(0), HasSubstr("Page 2: print is blurred"));
  EXPECT_THAT(read_bytes(folder_ / "report.html", 1 << 24), HasSubstr("scan it again"));
}

TEST_F(ReportTest, HostileTextStaysText) {
  Book book;
  const std::string attack = "\"><script>alert(1)</script><!-- evaluation begins -->\xff\x01";
  book.inputs.title = attack;
  book.inputs.cameras[0].name = attack;
  book.inputs.warnings = {attack};
  book.inputs.options.push_back({attack, attack, attack, attack});
  book.inputs.figures.push_back({attack, attack, attack, 1, attack, attack});
  book.surfaces[0].model_name = attack;
  write_report(folder_, book.inputs);
  add_evaluation(folder_, book.inputs.figures, {});
  EXPECT_THAT(html(), Not(HasSubstr("<script")));
  EXPECT_THAT(html(), Not(HasSubstr("\"><script")));
  EXPECT_NO_THROW(json());
}

TEST_F(ReportTest, SaysWhenNothingWasMeasured) {
  ReportInputs inputs;
  inputs.title = "black";
  write_report(folder_, inputs);
  EXPECT_EQ(json()["verdict"]["level"], "scan_again");
  EXPECT_THAT(html(), HasSubstr("Nothing could be measured"));

  const PointMap empty(8, 8);
  inputs.cameras.push_back({"cam1", 5, 5, nullptr, &empty, {}});
  const TimeMap no_times(8, 8);
  inputs.cameras.push_back({"cam2", 5, 5, &no_times, nullptr, {}});
  EXPECT_NO_THROW(write_report(folder_, inputs));
}

TEST_F(ReportTest, AnEvaluationReplacesAnEarlierOne) {
  const Book book;
  write_report(folder_, book.inputs);
  const std::vector<Figure> first{{"points", "rms", "the first figure", 0.08, "mm", ""}};
  const std::vector<Figure> second{{"points", "rms", "the second figure", 0.09, "mm", ""}};
  const std::vector<FigureMap> maps{{"points", "Points", "caption", "mm", Image<float>(40, 30, 0.1f), true}};
  add_evaluation(folder_, first, maps);
  EXPECT_THAT(html(), HasSubstr("the first figure"));
  add_evaluation(folder_, second, maps);
  EXPECT_THAT(html(), Not(HasSubstr("the first figure")));
  EXPECT_THAT(html(), HasSubstr("the second figure"));
  write_bytes(folder_ / "report.html", "something else");
  EXPECT_THROW(add_evaluation(folder_, second, maps), Error);
}

TEST(Judge, NamesWhatIsWrongAndWhatToDo) {
  Book book;
  EXPECT_EQ(judge(book.inputs).level, VerdictLevel::good);
  book.pages[1].measured_share = 0.9;
  EXPECT_EQ(judge(book.inputs).level, VerdictLevel::look);
  EXPECT_THAT(judge(book.inputs).remarks.at(0), HasSubstr("90.0 % of page 2"));
  book.pages[1].measured_share = 0.5;
  EXPECT_EQ(judge(book.inputs).level, VerdictLevel::scan_again);
  EXPECT_EQ(judge(book.inputs).advice, "Scan again.");
  book.pages[1].measured_share = 1;
  book.inputs.cameras[1].dropped = 20;
  EXPECT_THAT(judge(book.inputs).remarks.at(0), HasSubstr("lost 20 of 200 frames"));
  book.inputs.cameras[1].dropped = 0;
  for (int i = 0; i < 64 * 20; ++i) book.points[0].status.data()[i + 64 * 20] = PixelStatus::saturated;
  EXPECT_EQ(judge(book.inputs).level, VerdictLevel::good) << "the pages are complete: it is lost beside them";
  book.pages[1].measured_share = 0.9;
  EXPECT_THAT(judge(book.inputs).remarks.at(1), HasSubstr("expose shorter"));
}

TEST(EscapeHtml, LetsNoMarkupThrough) {
  EXPECT_EQ(escape_html("a<b>&\"'"), "a&lt;b&gt;&amp;&quot;&#39;");
  EXPECT_EQ(escape_html("Käse 書 🙂"), "Käse 書 🙂");
  EXPECT_EQ(escape_html("\xc0\xaf\xed\xa0\x80"), "\uFFFD\uFFFD\uFFFD\uFFFD\uFFFD") << "overlong, surrogate";
  EXPECT_EQ(escape_html(std::string_view("\0x", 2)), "\uFFFDx");
}

TEST(EncodeBase64, AsInTheStandard) {
  // RFC 4648, section 10.
  EXPECT_EQ(encode_base64(""), "");
  EXPECT_EQ(encode_base64("f"), "Zg==");
  EXPECT_EQ(encode_base64("fo"), "Zm8=");
  EXPECT_EQ(encode_base64("foo"), "Zm9v");
  EXPECT_EQ(encode_base64("foobar"), "Zm9vYmFy");
}

TEST(FormatNumber, ThreeDigitsOrWhole) {
  EXPECT_EQ(format_number(0.08125), "0.0813");
  EXPECT_EQ(format_number(-12.34), "−12.3");
  EXPECT_EQ(format_number(0.05), "0.05");
  EXPECT_EQ(format_number(9.999), "10.0");
  EXPECT_EQ(format_number(1234567), "1\u2009234\u2009567");
  EXPECT_EQ(format_number(1234), "1234");
  EXPECT_EQ(format_number(NAN), "–");
}

// Writes a full-size report to look at: PAGESWEEP_REPORT_SAMPLE=FOLDER report_test --gtest_filter=Sample.*
TEST(Sample, ToLookAt) {
  const char* folder = std::getenv("PAGESWEEP_REPORT_SAMPLE");
  if (!folder) GTEST_SKIP() << "set PAGESWEEP_REPORT_SAMPLE to a folder";
  fs::create_directories(folder);
  const Book book(640, 1400);
  write_report(folder, book.inputs);
  std::vector<FigureMap> maps;
  std::mt19937 random(1);
  std::normal_distribution<float> noise(0, 0.08f);
  for (const PointMap& map : book.points) {
    Image<float> errors = map.z;
    for (float& error : errors.pixels()) error = error * 0 + noise(random);
    maps.push_back(
        {"points", "Points against the true surface", "Fine grain is noise.", "mm", std::move(errors), true});
  }
  maps.push_back({"page_1", "Page 1 against the printed page", "After the best rotation.", "mm",
                  difference_of(book.surfaces[0]), false});
  const std::vector<Figure> figures{
      {"points", "rms", "distance to the true surface, rms", 0.083, "mm", ""},
      {"points", "p95", "distance that 95 % keep", 0.17, "mm", ""},
      {"page_1", "rms", "dewarping error, rms", 0.061, "mm", ""},
      {"page_2", "rms", "dewarping error, rms", NAN, "mm", "the result does not have this page"}};
  add_evaluation(folder, figures, maps);
}

}  // namespace
}  // namespace pagesweep
