// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/ply_file.h"

#include <bit>
#include <cmath>
#include <cstring>

#include "pagesweep/io/files_testing.h"

namespace pagesweep {
namespace {

using test::error_of;
using test::read_text;
using test::TestFolder;
using testing::AllOf;
using testing::HasSubstr;

std::vector<PointMap> some_maps() {
  std::vector<PointMap> maps;
  for (int c = 0; c < 2; ++c) {
    PointMap& map = maps.emplace_back(4, 3);
    for (int i = 0; i < 12; i += 2) {
      const auto f = static_cast<float>(i + 100 * c);
      const int x = i % 4, y = i / 4;
      map.x(x, y) = f;
      map.y(x, y) = -f;
      map.z(x, y) = f / 8;
      map.nx(x, y) = 0;
      map.ny(x, y) = 0.6F;
      map.nz(x, y) = 0.8F;
      map.intensity(x, y) = 3 * f;
      map.sigma(x, y) = 0.05F;
      map.status(x, y) = i == 4 ? PixelStatus::no_match : PixelStatus::ok;
    }
  }
  return maps;
}

/// Bytes of a number with the most significant one first.
template <class T>
std::string big_endian(T value) {
  std::string bytes(sizeof(T), 0);
  std::memcpy(bytes.data(), &value, sizeof(T));
  std::ranges::reverse(bytes);
  return bytes;
}

TEST(PlyFile, KeepsTheValidPoints) {
  const TestFolder folder;
  write_ply(folder / "a.ply", some_maps());
  const PointCloud cloud = read_ply(folder / "a.ply");
  ASSERT_EQ(cloud.size(), 10u);
  EXPECT_EQ(cloud.points[1], Eigen::Vector3f(2, -2, 0.25F));
  EXPECT_EQ(cloud.normals[1], Eigen::Vector3f(0, 0.6F, 0.8F));
  EXPECT_EQ(cloud.intensity[9], 330);
  EXPECT_EQ(cloud.sigma[9], 0.05F);
  EXPECT_EQ(cloud.camera[4], 1);
  EXPECT_EQ(cloud.camera[5], 2);
}

TEST(PlyFile, HasTheHeaderThatOtherProgramsKnow) {
  const TestFolder folder;
  write_ply(folder / "a.ply", some_maps());
  const std::string text = read_text(folder / "a.ply");
  EXPECT_TRUE(text.starts_with("ply\nformat binary_little_endian 1.0\n"));
  EXPECT_THAT(text,
              HasSubstr("element vertex 10\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\n"
                        "property float ny\nproperty float nz\nproperty float intensity\nproperty float sigma\n"
                        "property uchar camera\nend_header\n"));
  EXPECT_EQ(text.size(), text.find("end_header\n") + 11 + 10 * 33);
}

TEST(PlyFile, ReadsAsciiWithPropertiesInAnyOrder) {
  const TestFolder folder;
  test::put(folder / "a.ply",
            "ply\r\nformat ascii 1.0\r\ncomment by hand\r\nobj_info x\r\nelement thing 2\r\nproperty int a\r\n"
            "element vertex 2\r\nproperty double z\r\nproperty uchar red\r\nproperty list uchar int neighbours\r\n"
            "property float x\r\nproperty float y\r\nelement face 1\r\nproperty list uchar int vertex_indices\r\n"
            "end_header\r\n7\r\n8\r\n3.5 255 2 0 1 1e1 -2\r\n+4 0 0 nan 6\r\n3 0 1 0\r\n");
  const PointCloud cloud = read_ply(folder / "a.ply");
  ASSERT_EQ(cloud.size(), 2u);
  EXPECT_EQ(cloud.points[0], Eigen::Vector3f(10, -2, 3.5F));
  EXPECT_TRUE(std::isnan(cloud.points[1].x()));
  EXPECT_EQ(cloud.points[1].z(), 4);
  EXPECT_TRUE(std::isnan(cloud.normals[0].x()) && std::isnan(cloud.sigma[0]));
  EXPECT_EQ(cloud.camera[0], 0);
}

TEST(PlyFile, ReadsBigEndianOfEveryType) {
  const TestFolder folder;
  std::string bytes = "ply\nformat binary_big_endian 1.0\nelement vertex 1\n";
  for (const char* property : {"double x", "int y", "short z", "uint16 nx", "int8 ny", "uchar nz", "uint32 intensity"})
    bytes += std::string("property ") + property + "\n";
  bytes += "end_header\n" + big_endian(1.5) + big_endian(std::int32_t{-70000}) + big_endian(std::int16_t{-3}) +
           big_endian(std::uint16_t{65000}) + "\xfe\xfe" + big_endian(std::uint32_t{4000000000});
  test::put(folder / "a.ply", bytes);
  const PointCloud cloud = read_ply(folder / "a.ply");
  ASSERT_EQ(cloud.size(), 1u);
  EXPECT_EQ(cloud.points[0], Eigen::Vector3f(1.5F, -70000, -3));
  EXPECT_EQ(cloud.normals[0], Eigen::Vector3f(65000, -2, 254));
  EXPECT_EQ(cloud.intensity[0], 4e9F);
}

TEST(PlyFile, NamesWhatIsWrong) {
  const TestFolder folder;
  const auto message = [&](const std::string& text) {
    test::put(folder / "a.ply", text);
    return error_of([&] { read_ply(folder / "a.ply"); });
  };
  const std::string xyz = "property float x\nproperty float y\nproperty float z\n";
  EXPECT_THAT(message("solid\n"), AllOf(HasSubstr("a.ply: line 1"), HasSubstr("no PLY file")));
  EXPECT_THAT(message("ply\nformat ascii 1.0\n"), HasSubstr("\"end_header\", found the file's end"));
  EXPECT_THAT(message("ply\nelement vertex 1\n" + xyz + "end_header\n1 2 3\n"), HasSubstr("\"format ...\""));
  EXPECT_THAT(message("ply\nformat morse 1.0\n"), AllOf(HasSubstr("line 2"), HasSubstr("binary_little_endian")));
  EXPECT_THAT(message("ply\nformat ascii 1.0\nelement vertex many\n"), HasSubstr("number of elements"));
  EXPECT_THAT(message("ply\nformat ascii 1.0\nelement vertex -1\n"), HasSubstr("number of elements"));
  EXPECT_THAT(message("ply\nformat ascii 1.0\nproperty float x\n"), HasSubstr("an element before its properties"));
  EXPECT_THAT(message("ply\nformat ascii 1.0\nelement vertex 1\nproperty quad x\n"), HasSubstr("such as float"));
  EXPECT_THAT(message("ply\nformat ascii 1.0\nverse 1\n"), AllOf(HasSubstr("line 3"), HasSubstr("expected format")));
  EXPECT_THAT(message("ply\nformat ascii 1.0\nend_header\n"), HasSubstr("expected an element vertex"));
  EXPECT_THAT(message("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n"),
              AllOf(HasSubstr("element vertex"), HasSubstr("expected a property y")));
  EXPECT_THAT(message("ply\nformat ascii 1.0\nelement vertex 2\n" + xyz + "end_header\n1 2 3\n4 5\n"),
              HasSubstr("cut short"));
  EXPECT_THAT(message("ply\nformat ascii 1.0\nelement vertex 1\n" + xyz + "end_header\n1 two 3\n"),
              HasSubstr("expected a number, found \"two\""));
  EXPECT_THAT(message("ply\nformat binary_little_endian 1.0\nelement vertex 18446744073709551615\n" + xyz +
                      "end_header\nabcdefghijklmn"),
              HasSubstr("cut short"));
  EXPECT_THAT(error_of([&] { read_ply(folder / "b.ply"); }), HasSubstr("b.ply: cannot be read"));
}

TEST(PlyFile, NeverReadsBeyondAFileThatIsCutShort) {
  const TestFolder folder;
  write_ply(folder / "whole.ply", some_maps());
  const std::string whole = read_text(folder / "whole.ply");
  for (std::size_t length = 0; length < whole.size(); ++length) {
    test::put(folder / "cut.ply", std::string_view(whole).substr(0, length));
    EXPECT_NE(error_of([&] { read_ply(folder / "cut.ply"); }), "") << length;
  }
}

TEST(PlyFile, RefusesCallersMistakes) {
  const TestFolder folder;
  PointCloud cloud;
  cloud.points.emplace_back(1, 2, 3);
  EXPECT_THROW(write_ply(folder / "a.ply", cloud), std::invalid_argument);
}

}  // namespace
}  // namespace pagesweep
