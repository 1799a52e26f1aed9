// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>

#include <fstream>
#include <iterator>
#include <thread>

#include "pagesweep/base/error.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/live/scan_picture.h"

namespace pagesweep {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

fs::path fresh(const std::string& name) {
  const auto folder = fs::path(::testing::TempDir()) / ("scans_" + name);
  fs::remove_all(folder);
  fs::create_directories(folder);
  return folder;
}

Picture even_picture(std::uint8_t gray) {
  Picture picture = make_picture(40, 30, 1, 8);
  std::get<Image<std::uint8_t>>(picture.samples) = Image<std::uint8_t>(40, 30, gray);
  return picture;
}

std::uint8_t gray_of(const Picture& picture) { return std::get<Image<std::uint8_t>>(picture.samples)(5, 5); }

TEST(FolderPicture, TakesTheNewPictureWhenItIsWhole) {
  const fs::path folder = fresh("whole"), other = fresh("other");
  write_picture(folder / "old.png", even_picture(10));
  const auto scans = watch_folder(folder, 40, 30);
  write_picture(other / "new.png", even_picture(200));
  std::ifstream file(other / "new.png", std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  // The scanner's software writes half of it, and is busy for a while.
  std::jthread writer([&] {
    std::ofstream out(folder / "new.png", std::ios::binary);
    out << bytes.substr(0, bytes.size() / 2) << std::flush;
    std::this_thread::sleep_for(milliseconds(600));
    out << bytes.substr(bytes.size() / 2);
  });
  EXPECT_EQ(gray_of(scans->finish(milliseconds(1500))), 200);
}

TEST(FolderPicture, OneThatIsReplacedIsNew) {
  const fs::path folder = fresh("replaced");
  write_picture(folder / "scan.png", even_picture(10));
  const auto scans = watch_folder(folder, 40, 30);
  std::this_thread::sleep_for(milliseconds(20));
  write_picture(folder / "scan.png", even_picture(77));
  EXPECT_EQ(gray_of(scans->finish(milliseconds(1500))), 77);
}

TEST(FolderPicture, SaysWhatIsMissing) {
  const fs::path folder = fresh("missing");
  EXPECT_THROW(watch_folder(folder / "nowhere", 40, 30), Error);
  EXPECT_THROW(watch_folder(folder, 40, 30)->finish(milliseconds(200)), Error);
  const auto scans = watch_folder(folder, 41, 30);
  write_picture(folder / "scan.png", even_picture(77));
  try {
    scans->finish(milliseconds(1500));
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("expected 41 x 30 pixels"));
  }
}

}  // namespace
}  // namespace pagesweep
