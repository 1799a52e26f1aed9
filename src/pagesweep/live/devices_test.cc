// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/live/devices.h"

#include <gmock/gmock.h>

#include <fstream>

#include "pagesweep/base/error.h"

namespace pagesweep {
namespace {

std::filesystem::path file_with(const std::string& text) {
  const auto file = std::filesystem::path(::testing::TempDir()) / "devices.json";
  std::ofstream(file) << text;
  return file;
}

TEST(Devices, AreReadAsTheyWereWritten) {
  Devices devices;
  DeviceSettings& settings = devices.cameras["cam1"];
  settings.pixel_format = "Mono12";
  settings.width = 640, settings.height = 480, settings.left = 16;
  settings.exposure_us = 1500.5;
  settings.trigger = TriggerMode::software;
  settings.packet_size = 8192;
  settings.dark_level = 2.5;
  settings.frame_rate = 12.5, settings.gain = 3;
  settings.is_reversed = true, settings.rows_a_buffer = 77;
  const auto file = std::filesystem::path(::testing::TempDir()) / "written.json";
  write_devices(file, devices);
  const DeviceSettings read = read_devices(file).of("cam1");
  EXPECT_EQ(read.pixel_format, "Mono12");
  EXPECT_EQ(read.left, 16);
  EXPECT_EQ(read.exposure_us, 1500.5);
  EXPECT_EQ(read.trigger, TriggerMode::software);
  EXPECT_EQ(read.packet_size, 8192);
  EXPECT_EQ(read.dark_level, 2.5);
  EXPECT_FALSE(read.black_level);
  EXPECT_EQ(read.frame_rate, 12.5);
  EXPECT_EQ(read.gain, 3);
  EXPECT_TRUE(read.is_reversed);
  EXPECT_EQ(read.rows_a_buffer, 77);
}

TEST(Devices, ACameraThatIsNotNamedHasDefaults) { EXPECT_EQ(Devices().of("cam9").trigger, TriggerMode::hardware); }

TEST(Devices, NameWhatIsWrong) {
  const auto file = file_with(R"({"format": "pagesweep-devices", "version": 1,
                                  "cameras": {"cam2": {"trigger": "sometimes"}}})");
  try {
    read_devices(file);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("cameras.cam2.trigger"));
    EXPECT_THAT(error.what(), ::testing::HasSubstr("free-running"));
  }
}

}  // namespace
}  // namespace pagesweep
