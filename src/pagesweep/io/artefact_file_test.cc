// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/artefact_file.h"

#include "pagesweep/io/files_testing.h"

namespace pagesweep {
namespace {

using test::error_of;
using test::replaced;
using test::TestFolder;
using testing::AllOf;
using testing::HasSubstr;

const std::string sound = R"({"format": "pagesweep-artefact", "version": 1, "name": "no. 7",
  "plate": {"size_mm": [120, 180]}, "spheres": [{"diameter_mm": 40.001}, {"diameter_mm": 39.998}],
  "spacing_mm": 200.003})";

TEST(ArtefactFile, ReadsAllParts) {
  const TestFolder folder;
  test::put(folder / "artefact.json", sound);
  const Artefact artefact = read_artefact(folder / "artefact.json");
  EXPECT_EQ(artefact.name, "no. 7");
  EXPECT_EQ(*artefact.plate_mm, Eigen::Vector2d(180, 120));
  EXPECT_EQ(artefact.sphere_diameters_mm, (std::vector<double>{40.001, 39.998}));
  EXPECT_EQ(*artefact.spacing_mm, 200.003);
}

TEST(ArtefactFile, ReadsAPlateAlone) {
  const TestFolder folder;
  test::put(folder / "artefact.json",
            R"({"format": "pagesweep-artefact", "version": 1, "plate": {"size_mm": [300, 50]}})");
  const Artefact artefact = read_artefact(folder / "artefact.json");
  EXPECT_TRUE(artefact.plate_mm);
  EXPECT_TRUE(artefact.sphere_diameters_mm.empty());
  EXPECT_FALSE(artefact.spacing_mm);
}

TEST(ArtefactFile, NamesFileFieldAndWhatWasExpected) {
  const TestFolder folder;
  struct Damage {
    std::string from, to, place, hint;
  };
  const Damage damages[] = {
      {"pagesweep-artefact", "artefact", "format", "expected \"pagesweep-artefact\""},
      {"[120, 180]", "[120]", "plate.size_mm", "expected 2 numbers"},
      {"[120, 180]", "[0, 180]", "plate.size_mm", "expected sides from 1"},
      {"40.001", "\"large\"", "spheres[0].diameter_mm", "expected a number"},
      {"39.998}", "39.998}, {\"diameter_mm\": 40}", "spheres", "expected one or two"},
      {", {\"diameter_mm\": 39.998}", "", "spacing_mm", "needs two spheres"},
      {"200.003", "20", "spacing_mm", "do not overlap"},
  };
  for (const Damage& damage : damages) {
    test::put(folder / "artefact.json", replaced(sound, damage.from, damage.to));
    EXPECT_THAT(error_of([&] { read_artefact(folder / "artefact.json"); }),
                AllOf(HasSubstr("artefact.json: " + damage.place + ": "), HasSubstr(damage.hint)))
        << damage.from << " -> " << damage.to;
  }
  test::put(folder / "artefact.json", R"({"format": "pagesweep-artefact", "version": 1})");
  EXPECT_THAT(error_of([&] { read_artefact(folder / "artefact.json"); }), HasSubstr("nothing to measure"));
}

}  // namespace
}  // namespace pagesweep
