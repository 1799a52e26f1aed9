// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/capture_file.h"

#include <gtest/gtest.h>

#include "pagesweep/io/image_file.h"
#include "pagesweep/io/rig_file.h"
#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {
TEST(Smoke, RoundTrip) {
  const std::filesystem::path dir = testing::TempDir() + "/smoke";
  std::filesystem::remove_all(dir);
  const Rig rig = sim::make_test_rig(32);
  write_rig(dir / "rig.json", rig);
  Capture c;
  c.folder = dir;
  c.sequences = {{rig.cameras[0].name, "cam1/%06d.png", 0, 20, 8, 2, 255}};
  write_capture(c);
  for (int i = 0; i < 20; i += 2)
    write_gray_png(c.frame_path(c.sequences[0], i), Image<std::uint8_t>(32, 32, i).view());
  const Capture back = read_capture(dir);
  const auto source = open_capture(back, read_capture_rig(back));
  const auto frames = read_all(*source);
  EXPECT_EQ(frames[0].dropped(), 10);
  EXPECT_EQ(std::get<0>(frames[0].frame(6))(3, 3), 6);
  Picture p = make_picture(20, 10, 3, 16);
  p.pixels_per_mm = 11.811;
  write_picture(dir / "a.tiff", p);
  EXPECT_NEAR(read_picture(dir / "a.tiff").pixels_per_mm, 11.811, 1e-3);
}
}  // namespace
}  // namespace pagesweep
