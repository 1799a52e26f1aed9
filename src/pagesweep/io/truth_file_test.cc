// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/truth_file.h"

#include "pagesweep/io/files_testing.h"
#include "pagesweep/io/float_tiff.h"

namespace pagesweep {
namespace {

using test::error_of;
using test::read_text;
using test::replaced;
using test::TestFolder;
using testing::AllOf;
using testing::HasSubstr;

Truth some_truth(const TestFolder& folder) {
  Truth truth;
  truth.folder = folder.path();
  truth.pages = {{1, 11.811, 8, "page_1.txt"}, {2, 5.9055, 4, ""}};
  truth.stripe = {1.5, 12};
  truth.sensor = {40, 1.25};
  truth.profile = {-6, 0.25, {0, 0.5, 1, 0.5, 0}};
  return truth;
}

TEST(TruthFile, KeepsWhatWasWritten) {
  const TestFolder folder;
  write_truth(some_truth(folder));
  for (const auto& path : {folder.path(), folder / "truth.json"}) {
    const Truth back = read_truth(path);
    EXPECT_EQ(back.folder, folder.path());
    ASSERT_EQ(back.pages.size(), 2u);
    EXPECT_EQ(back.pages[0].pixels_per_mm, 11.811);
    EXPECT_EQ(back.pages[0].text, "page_1.txt");
    EXPECT_EQ(back.pages[1].index, 2);
    EXPECT_EQ(back.pages[1].points_subsampling, 4);
    EXPECT_EQ(back.stripe->fwhm_mm, 12);
    EXPECT_EQ(back.sensor->read_noise_gray, 1.25);
    EXPECT_EQ(back.profile->values, (std::vector<double>{0, 0.5, 1, 0.5, 0}));
  }
}

TEST(TruthFile, ReadsOneWithoutExtensions) {
  const TestFolder folder;
  test::put(folder / "truth.json",
            R"({"format": "pagesweep-truth", "version": 1, "pages": [{"index": 1, "pixels_per_mm": 11.811}]})");
  const Truth truth = read_truth(folder.path());
  EXPECT_EQ(truth.pages[0].points_subsampling, 1);
  EXPECT_FALSE(truth.stripe || truth.sensor || truth.profile);
}

TEST(TruthFile, FindsItsMaps) {
  const TestFolder folder;
  const Truth truth = some_truth(folder);
  Image<Eigen::Vector3f> points(3, 2, Eigen::Vector3f::Ones());
  write_vector_tiff(folder / "cam1_points.tiff", points);
  write_vector_tiff(folder / "page_2_points.tiff", points);
  write_scan_map(folder / "page_2_scanmap.tiff", ScanMap(7, 5));
  EXPECT_EQ(read_camera_points(truth, "cam1")(2, 1), Eigen::Vector3f(1, 1, 1));
  EXPECT_EQ(read_page_points(truth, 2).width(), 3);
  EXPECT_EQ(read_page_scan_map(truth, 2).width(), 7);
  EXPECT_EQ(truth.page_path(2), folder / "page_2.png");
  EXPECT_THAT(error_of([&] { read_camera_points(truth, "cam2"); }), HasSubstr("cam2_points.tiff: cannot be read"));
}

TEST(TruthFile, NamesFileFieldAndWhatWasExpected) {
  const TestFolder folder;
  write_truth(some_truth(folder));
  const std::string sound = read_text(folder / "truth.json");
  struct Damage {
    std::string from, to, place, hint;
  };
  const Damage damages[] = {
      {"pagesweep-truth", "truth", "format", "expected \"pagesweep-truth\""},
      {"\"pages\"", "\"leaves\"", "pages", "is missing"},
      {"\"index\": 2", "\"index\": 1", "pages[1].index", "a page 1 already"},
      {"\"pixels_per_mm\": 11.811", "\"pixels_per_mm\": 0", "pages[0].pixels_per_mm", "expected a number from"},
      {"\"points_subsampling\": 8", "\"points_subsampling\": 0", "pages[0].points_subsampling", "from 1"},
      {"\"mm_per_frame\": 1.5", "\"mm_per_frame\": true", "stripe.mm_per_frame", "expected a number, found true"},
      {"\"gain_e_per_gray\": 40.0", "\"gain\": 40.0", "sensor.gain_e_per_gray", "is missing"},
      {"\"step_frames\": 0.25", "\"step_frames\": 0", "profile.step_frames", "expected a number from"},
      {"[0.0, 0.5, 1.0, 0.5, 0.0]", "[1]", "profile.values", "at least 2"},
  };
  for (const Damage& damage : damages) {
    test::put(folder / "truth.json", replaced(sound, damage.from, damage.to));
    EXPECT_THAT(error_of([&] { read_truth(folder.path()); }),
                AllOf(HasSubstr("truth.json: " + damage.place + ": "), HasSubstr(damage.hint)))
        << damage.from << " -> " << damage.to;
  }
}

}  // namespace
}  // namespace pagesweep
