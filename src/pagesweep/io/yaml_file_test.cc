// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/yaml_file.h"

#include <fmt/format.h>

#include "pagesweep/io/files_testing.h"

namespace pagesweep {
namespace {

using test::error_of;
using test::TestFolder;
using testing::ElementsAre;
using testing::HasSubstr;

JsonReader read(const TestFolder& folder, const std::string& text) {
  test::put(folder / "file.yml", text);
  return read_yaml(folder / "file.yml");
}

TEST(YamlFile, ReadsNumbersAsEveryProgramWritesThem) {
  const TestFolder folder;
  const JsonReader json = read(folder, "a: [1, -2., +.5, 1e-05, 7.25E+2]\n");
  EXPECT_THAT(json.at("a").numbers(), ElementsAre(1, -2, 0.5, 1e-5, 725));
}

TEST(YamlFile, TakesForTextWhatIsNoFiniteNumber) {
  const TestFolder folder;
  const JsonReader json = read(folder, "a: .Nan\nb: inf\nc: 1e999\nd: \"7\"\ne: 0x10\nf: true\n");
  for (const char* name : {"a", "b", "c", "d", "e", "f"})
    EXPECT_THAT(error_of([&] { json.at(name).number(); }), HasSubstr("expected a number, found a string")) << name;
  EXPECT_EQ(json.at("d").text(), "7");
}

TEST(YamlFile, ReadsOpenCvsFirstLineWithOrWithoutTheDashes) {
  const TestFolder folder;
  EXPECT_EQ(read(folder, "%YAML:1.0\n---\na: !!opencv-matrix\n   rows: 3\n").at("a").at("rows").number(), 3);
  EXPECT_EQ(read(folder, "%YAML:1.0\na: !!opencv-matrix\n   rows: 3\n").at("a").at("rows").number(), 3);
}

TEST(YamlFile, SaysWhereItBreaks) {
  const TestFolder folder;
  EXPECT_THAT(error_of([&] { read(folder, "%YAML:1.0\n---\na: [1\nb: 2\n"); }), HasSubstr("file.yml: line 4, column "));
}

TEST(YamlFile, IsNotDrownedByAliases) {
  const TestFolder folder;
  std::string text = "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n";
  for (int i = 1; i < 12; ++i) {
    text += fmt::format("a{0}: &a{0} [*a{1}", i, i - 1);
    for (int k = 1; k < 10; ++k) text += fmt::format(", *a{}", i - 1);
    text += "]\n";
  }
  EXPECT_THAT(error_of([&] { read(folder, text); }), HasSubstr("found far more"));
  EXPECT_THAT(error_of([&] { read(folder, "a: &a [*a]\n"); }), HasSubstr("in a circle"));
  EXPECT_THAT(error_of([&] { read(folder, std::string(100'000, '[')); }), HasSubstr("file.yml: "));
}

}  // namespace
}  // namespace pagesweep
