// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/atomic_file.h"

#include <sys/resource.h>

#include <csignal>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "pagesweep/io/files_testing.h"
#include "pagesweep/io/float_tiff.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/json_file.h"
#include "pagesweep/io/ply_file.h"

namespace pagesweep {
namespace {

using test::error_of;
using test::read_text;
using test::TestFolder;
using testing::AllOf;
using testing::HasSubstr;

TEST(AtomicFile, AppearsOnlyWhenCommitted) {
  const TestFolder folder;
  {
    AtomicFile file(folder / "a.tiff");
    EXPECT_EQ(file.temporary().extension(), ".tiff");
    EXPECT_EQ(file.temporary().parent_path(), folder.path());
    std::ofstream(file.temporary()) << "whole";
    EXPECT_FALSE(std::filesystem::exists(folder / "a.tiff"));
    file.commit();
  }
  EXPECT_EQ(read_text(folder / "a.tiff"), "whole");
  EXPECT_EQ(folder.files(), 1u);
}

TEST(AtomicFile, LeavesTheOldFileAndNothingElseWithoutCommit) {
  const TestFolder folder;
  write_bytes(folder / "a.txt", "old");
  {
    AtomicFile file(folder / "a.txt");
    std::ofstream(file.temporary()) << "half";
  }
  EXPECT_EQ(read_text(folder / "a.txt"), "old");
  EXPECT_EQ(folder.files(), 1u);
}

TEST(AtomicFile, MakesTheFolderThatItNeeds) {
  const TestFolder folder;
  write_bytes(folder / "x/y/a.txt", "deep");
  EXPECT_EQ(read_text(folder / "x/y/a.txt"), "deep");
}

TEST(AtomicFile, TwoOfOneTargetDoNotDisturbEachOther) {
  const TestFolder folder;
  AtomicFile first(folder / "a.txt"), second(folder / "a.txt");
  EXPECT_NE(first.temporary(), second.temporary());
}

TEST(AtomicFile, SaysWhatCannotBeWritten) {
  const TestFolder folder;
  write_bytes(folder / "file", "");
  EXPECT_THAT(error_of([&] { AtomicFile(folder / "file/a.txt"); }),
              AllOf(HasSubstr("a.txt"), HasSubstr("cannot be written")));
  EXPECT_THAT(error_of([&] { AtomicFile(folder.path()); }), HasSubstr("it is a folder"));
  EXPECT_THAT(error_of([&] { AtomicFile(folder.path() / ""); }), HasSubstr("no file name"));
  try {
    AtomicFile(folder / "file/a.txt");
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), ErrorKind::cannot_write);
  }
}

/// A disk on which no file can grow beyond some bytes.
class SmallDisk {
 public:
  explicit SmallDisk(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &old_);
    const rlimit small{bytes, old_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &small);
  }
  ~SmallDisk() {
    setrlimit(RLIMIT_FSIZE, &old_);
    std::signal(SIGXFSZ, handler_);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

 private:
  void (*handler_)(int);
  rlimit old_{};
};

TEST(AtomicFile, EveryWriterSaysThatTheDiskIsFullAndLeavesNothing) {
  const TestFolder folder;
  Image<float> noise(64, 64);
  unsigned state = 1;
  for (float& value : noise.pixels()) value = static_cast<float>(state = state * 1664525 + 1013904223);
  Picture picture = make_picture(64, 64, 1, 8);
  std::ranges::copy(std::as_bytes(noise.pixels()).first(64 * 64),
                    std::as_writable_bytes(std::get<0>(picture.samples).pixels()).begin());
  PointCloud cloud;
  cloud.points.resize(100);
  cloud.normals.resize(100);
  cloud.intensity.resize(100);
  cloud.sigma.resize(100);
  cloud.camera.resize(100);
  const std::vector<std::pair<std::string, std::function<void()>>> writers = {
      {"gray.png", [&] { write_gray_png(folder / "gray.png", std::get<0>(picture.samples).view()); }},
      {"page.png", [&] { write_picture(folder / "page.png", picture); }},
      {"page.tif", [&] { write_picture(folder / "page.tif", picture); }},
      {"page.jpg", [&] { write_picture(folder / "page.jpg", picture); }},
      {"page.jp2", [&] { write_picture(folder / "page.jp2", picture); }},
      {"map.tiff", [&] { write_float_tiff(folder / "map.tiff", {noise.view()}); }},
      {"points.ply", [&] { write_ply(folder / "points.ply", cloud); }},
      {"report.json", [&] { write_json(folder / "report.json", std::string(2000, 'x')); }}};
  for (const auto& [name, write] : writers) {
    std::string message;
    {
      const SmallDisk disk(1000);
      message = error_of(write);
    }
    EXPECT_THAT(message, HasSubstr(name + ": cannot be written")) << name;
    EXPECT_EQ(folder.files(), 0u) << name;
    EXPECT_EQ(error_of(write), "") << name;
    std::filesystem::remove(folder / name);
  }
}

TEST(AtomicFile, FilesWrittenTogetherAppearTogether) {
  const TestFolder folder;
  const NamedText files[] = {{"a.txt", "one"}, {"b.txt", "two"}};
  std::filesystem::create_directory(folder / "b.txt");
  EXPECT_THAT(error_of([&] { write_together(folder.path(), files); }), HasSubstr("b.txt: cannot be written"));
  EXPECT_EQ(folder.files(), 0u);
  std::filesystem::remove(folder / "b.txt");
  write_together(folder / "new", files);
  EXPECT_EQ(read_text(folder / "new/a.txt") + read_text(folder / "new/b.txt"), "onetwo");
}

TEST(ReadBytes, RefusesWhatIsTooLarge) {
  const TestFolder folder;
  write_bytes(folder / "a.txt", "12345");
  EXPECT_EQ(read_bytes(folder / "a.txt", 5), "12345");
  EXPECT_THAT(error_of([&] { read_bytes(folder / "a.txt", 4); }), HasSubstr("at most 4 bytes"));
}

TEST(JsonFile, KeepsShortThingsOnOneLine) {
  const nlohmann::ordered_json json = {{"name", "a\nb"},
                                       {"row", std::vector<int>(60, 7)},
                                       {"things", {{{"x", 1}, {"y", {0.1, 1e-9}}}, {{"x", 2}, {"y", nullptr}}}},
                                       {"none", nlohmann::ordered_json::array()}};
  const std::string text = format_json(json);
  EXPECT_EQ(nlohmann::ordered_json::parse(text), json);
  EXPECT_THAT(text, HasSubstr("{\n  \"name\": \"a\\nb\",\n  \"row\": [7, 7,"));
  EXPECT_THAT(text, HasSubstr("\"things\": [{\"x\": 1, \"y\": [0.1, 1e-09]}, {\"x\": 2, \"y\": null}]"));
  EXPECT_TRUE(text.ends_with("\"none\": []\n}\n"));
}

}  // namespace
}  // namespace pagesweep
