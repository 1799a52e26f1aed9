// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/rig_conversion.h"

#include <fmt/format.h>

#include <vector>

#include "pagesweep/io/files_testing.h"
#include "pagesweep/io/rig_testing.h"

namespace pagesweep {
namespace {

using test::error_of;
using test::expect_near;
using test::TestFolder;
using testing::HasSubstr;
using Paths = std::vector<std::filesystem::path>;

TEST(RigConversion, TellsEveryFormatThatItWrote) {
  const TestFolder folder;
  const Rig rig = test::two_cameras();
  EXPECT_EQ(export_rig(folder / "rig.yml", rig), RigFormat::opencv);
  EXPECT_EQ(export_rig(folder / "camchain-book.yaml", rig), RigFormat::kalibr);
  export_rig(folder / "stereo", rig, {.format = RigFormat::opencv_stereo});
  export_rig(folder / "model", rig, {.format = RigFormat::colmap});
  expect_near(import_rig(Paths{folder / "rig.yml"}), rig);
  expect_near(import_rig(Paths{folder / "stereo"}), rig);
  expect_near(import_rig(Paths{folder / "stereo/extrinsics.yml", folder / "stereo/intrinsics.yml"}), rig);
  expect_near(import_rig(Paths{folder / "model"}), rig);
  expect_near(import_rig(Paths{folder / "model/images.txt", folder / "model/cameras.txt"}), rig);
  expect_near(import_rig(Paths{folder / "camchain-book.yaml"}, {.names = "cam1,cam2"}), rig);
}

TEST(RigConversion, MeasuresInTheUnitThatWasGiven) {
  const TestFolder folder;
  const Rig rig = test::two_cameras();
  export_rig(folder / "mm.yml", rig);
  for (const auto& [unit, mm] : {std::pair("mm", 1.0), std::pair("cm", 10.0), std::pair("m", 1000.0),
                                 std::pair("25.4", 25.4), std::pair("7.5e0", 7.5)}) {
    const Rig scaled = import_rig(Paths{folder / "mm.yml"}, {.unit = unit});
    const Eigen::Vector3d expected = mm * rig.cameras[0].cam_from_rig.translation;
    EXPECT_LT((scaled.cameras[0].cam_from_rig.translation - expected).norm(), 1e-9 * mm) << unit;
    for (const RigFormat format : {RigFormat::opencv, RigFormat::colmap}) {
      const auto output = folder / fmt::format("{} {}", unit, name_of(format));
      export_rig(output, rig, {.format = format, .unit = unit});
      expect_near(import_rig(Paths{output}, {.format = format, .unit = unit}), rig);
    }
  }
}

TEST(RigConversion, RefusesOptionsThatCannotBeMeant) {
  const TestFolder folder;
  const Rig rig = test::two_cameras();
  const Paths file = {folder / "rig.yml"}, chain = {folder / "camchain.yml"};
  export_rig(file[0], rig);
  export_rig(chain[0], rig);
  for (const char* unit : {"", "inch", "0", "-1", "nan", "1e99", "1 mm"})
    EXPECT_THROW(import_rig(file, {.unit = unit}), std::invalid_argument) << unit;
  for (const char* size : {"640", "640x", "x480", "640x480x3", "0x480", "640.5x480", "1e9x1"})
    EXPECT_THROW(import_rig(file, {.image_size = size}), std::invalid_argument) << size;
  for (const char* names : {"left", "left,right,top", "left,left", "left,", "../left,right"})
    EXPECT_THROW(import_rig(file, {.names = names}), std::invalid_argument) << names;
  EXPECT_THROW(import_rig(chain, {.unit = "cm"}), std::invalid_argument);
  EXPECT_THROW(import_rig(Paths{chain[0], chain[0]}), std::invalid_argument);
  EXPECT_THROW(import_rig(Paths{}), std::invalid_argument);
  EXPECT_THROW(export_rig(folder / "out", rig), std::invalid_argument) << "the name does not tell the format";
}

TEST(RigConversion, SaysWhatIsMissing) {
  const TestFolder folder;
  const auto message = [&](const std::string& input, const RigConversionOptions& options = {}) {
    return error_of([&] { import_rig(Paths{folder / input}, options); });
  };
  EXPECT_THAT(message("absent"), HasSubstr("absent: cannot be read: there is no such file or folder"));
  EXPECT_THAT(message(""), HasSubstr("neither COLMAP's cameras.txt"));
  test::put(folder / "model/cameras.bin", "binary");
  EXPECT_THAT(message("model"), HasSubstr("colmap model_converter"));
  test::put(folder / "alone/cameras.txt", "1 PINHOLE 4 2 10 10 2 1\n");
  EXPECT_THAT(message("alone/cameras.txt"), HasSubstr("images.txt: cannot be read: it is not among the inputs"));
  EXPECT_THAT(message("alone"), HasSubstr("images.txt: cannot be read"));
  test::put(folder / "stereo/intrinsics.yml", "M1: 1\n");
  EXPECT_THAT(message("stereo"), HasSubstr("extrinsics.yml: cannot be read"));
}

TEST(RigConversion, SaysWhatIsLost) {
  Rig rig = test::two_cameras();
  EXPECT_EQ(lost_by_export(rig), "");
  rig.cameras[1].sensor = CameraSensor{};
  EXPECT_EQ(lost_by_export(rig), "sensors");
  rig.light = Light(TranslatingPlane{{0, 1, 0}, -150, 1.5});
  rig.scanner = Scanner(rig.cameras[0]);
  EXPECT_EQ(lost_by_export(rig), "scanner, light, sensors");
}

}  // namespace
}  // namespace pagesweep
