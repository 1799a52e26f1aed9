// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/print.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "pagesweep/sim/texture.h"

namespace pagesweep::sim {
namespace {

PrintDesign make_design() {
  PrintDesign design;
  design.width_mm = 100;
  design.height_mm = 120;
  design.texts = {"# A heading\n\nOne paragraph of a few words.\n\nAnother one."};
  design.footer = std::string("7");
  return design;
}

TEST(PrintSheet, SaysWhatItPrinted) {
  const PrintedSheet sheet = print_sheet(make_design(), 4);
  EXPECT_EQ(sheet.text, "A heading\n\nOne paragraph of a few words.\n\nAnother one.\n\n7");
  EXPECT_FALSE(sheet.text_was_cut);
  EXPECT_EQ(sheet.albedo.width(), 400);
  EXPECT_EQ(sheet.albedo.height(), 480);
}

TEST(PrintSheet, KeepsToTheInkAndToTheMargins) {
  const PrintDesign design = make_design();
  const PrintedSheet sheet = print_sheet(design, 8);
  const auto [darkest, brightest] = std::ranges::minmax(sheet.albedo.pixels());
  EXPECT_NEAR(darkest, design.ink_albedo, 1e-3);
  EXPECT_NEAR(brightest, design.paper_albedo, 1e-6);
  for (int y = 0; y < sheet.albedo.height(); ++y)
    for (int x = 0; x < 8 * 19; ++x) {
      ASSERT_NEAR(sheet.albedo(x, y), design.paper_albedo, 1e-6);
      ASSERT_NEAR(sheet.albedo(sheet.albedo.width() - 1 - x, y), design.paper_albedo, 1e-6);
    }
}

TEST(PrintSheet, SaysWhenTextFindsNoRoom) {
  PrintDesign design = make_design();
  for (int i = 0; i < 100; ++i) design.texts.push_back("Line after line until the page is full.");
  const PrintedSheet sheet = print_sheet(design, 4);
  EXPECT_TRUE(sheet.text_was_cut);
  EXPECT_LT(std::ranges::count(sheet.text, '.'), 60);
  EXPECT_TRUE(sheet.text.ends_with("7"));
}

TEST(PrintSheet, LetsTextFlowRoundAFigure) {
  PrintDesign design = make_design();
  design.figures = {{FigureKind::black, 20, 30, 60, 40}};
  const PrintedSheet sheet = print_sheet(design, 4);
  for (int y = 4 * 32; y < 4 * 68; ++y)
    for (int x = 4 * 22; x < 4 * 78; ++x) {
      ASSERT_GE(sheet.albedo(x, y), 0.03f);  // the picture alone: ink would not be this bright beside
      ASSERT_LE(sheet.albedo(x, y), 0.08f);
    }
}

TEST(Texture, InterpolatesBetweenTexelCentres) {
  Image<float> ramp(64, 32);
  for (int y = 0; y < 32; ++y)
    for (int x = 0; x < 64; ++x) ramp(x, y) = float(x) + 100 * float(y);
  const Texture texture(ramp, 2);
  EXPECT_NEAR(texture.at(10, 5, 0), 19.5 + 100 * 9.5, 1e-3);
  // A ramp keeps its value at every level.
  EXPECT_NEAR(texture.at(10, 5, 2), 19.5 + 100 * 9.5, 1e-3);
  EXPECT_EQ(texture.level_for(0.1), 0);
  EXPECT_EQ(texture.level_for(2.0), 2);
  EXPECT_EQ(Texture(0.3f).at(7, 8, 0), 0.3f);
}

}  // namespace
}  // namespace pagesweep::sim
