// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/delivery/deliver.h"

#include <fmt/format.h>

#include <pugixml.hpp>
#include <set>

#include "pagesweep/delivery/alto.h"
#include "pagesweep/delivery/checksum.h"
#include "pagesweep/delivery/xml_structure_testing.h"
#include "pagesweep/io/files_testing.h"
#include "pagesweep/io/pages_file.h"
#include "pagesweep/ocr/recognise_text.h"
#include "pagesweep/ocr/typeset_page_testing.h"

namespace pagesweep {
namespace {

namespace fs = std::filesystem;
using test::error_of;
using test::read_text;
using test::TestFolder;
using testing::AllOf;
using testing::HasSubstr;

const DeliveryOrigin origin{"pagesweep test", "2026-11-22T18:00:00Z"};

/// A page of an even gray.
fs::path write_page(const TestFolder& folder, const std::string& name, int gray) {
  Picture page = make_picture(60, 80, 3, 8);
  for (std::uint8_t& sample : std::get<0>(page.samples).pixels()) sample = static_cast<std::uint8_t>(gray);
  page.pixels_per_mm = 300 / 25.4;
  write_picture(folder / name, page);
  return folder / name;
}

std::vector<PageSource> some_sources(const TestFolder& folder, int count = 3) {
  std::vector<fs::path> pages;
  for (int i = 0; i < count; ++i) pages.push_back(write_page(folder, fmt::format("p{}.png", i), 100 + i));
  return find_pages(pages);
}

pugi::xml_document load(const fs::path& file) {
  pugi::xml_document document;
  EXPECT_TRUE(document.load_file(file.c_str())) << file;
  return document;
}

TEST(Deliver, WritesWhatIsAskedForAndNothingElse) {
  const TestFolder folder;
  const auto sources = some_sources(folder);
  const Delivery delivery =
      deliver(sources, folder / "job", {.formats = "tiff,png,jpeg,jp2,pdf", .page_name = "b{page:03}", .first_page = 9},
              origin);
  EXPECT_EQ(delivery.pages.size(), 3u);
  for (const char* file : {"tiff/b009.tif", "png/b010.png", "jpeg/b011.jpg", "jp2/b009.jp2", "job.pdf", "mets.xml"})
    EXPECT_TRUE(fs::exists(folder / "job" / file)) << file;
  EXPECT_FALSE(fs::exists(folder / "job/records"));
  EXPECT_EQ(folder.files(), 3u + 4 * 3 + 2);
  EXPECT_EQ(std::get<0>(read_picture(folder / "job/tiff/b011.tif").samples)(0, 0), 102);
}

TEST(Deliver, TheMetsListsEachFileWithItsChecksumAndThePagesInOrder) {
  const TestFolder folder;
  deliver(some_sources(folder), folder / "job", {.formats = "tiff,jp2,pdf", .first_page = 7, .title = "A & B"}, origin);
  const auto mets = load(folder / "job/mets.xml");
  const pugi::xml_node root = mets.child("mets");
  EXPECT_STREQ(root.attribute("xmlns").value(), "http://www.loc.gov/METS/");
  EXPECT_STREQ(root.attribute("LABEL").value(), "A & B");
  std::vector<std::string> sections;
  for (const auto& child : root.children()) sections.emplace_back(child.name());
  EXPECT_THAT(sections, testing::ElementsAre("metsHdr", "dmdSec", "fileSec", "structMap"));  // the schema's order
  std::set<std::string> ids;
  for (const auto& group : root.child("fileSec").children("fileGrp"))
    for (const auto& file : group.children("file")) {
      EXPECT_TRUE(ids.insert(file.attribute("ID").value()).second);
      EXPECT_STREQ(file.attribute("CHECKSUMTYPE").value(), "SHA-256");
      const fs::path path = folder / "job" / file.child("FLocat").attribute("xlink:href").value();
      EXPECT_EQ(sha256_of(path), file.attribute("CHECKSUM").value());
      EXPECT_EQ(fs::file_size(path), file.attribute("SIZE").as_ullong());
    }
  EXPECT_EQ(ids.size(), 7u);
  int order = 0;
  const pugi::xml_node sequence = root.child("structMap").child("div");
  for (const auto& page : sequence.children("div")) {
    EXPECT_EQ(page.attribute("ORDER").as_int(), ++order);
    EXPECT_EQ(page.attribute("ORDERLABEL").as_int(), order + 6);
    for (const auto& file : page.children("fptr")) EXPECT_EQ(ids.erase(file.attribute("FILEID").value()), 1u);
  }
  EXPECT_EQ(order, 3);
  EXPECT_EQ(ids.erase(sequence.child("fptr").attribute("FILEID").value()), 1u);
  EXPECT_TRUE(ids.empty());
}

TEST(Deliver, WhatWasDeliveredCanBeChecked) {
  const TestFolder folder;
  deliver(some_sources(folder), folder / "job", {.formats = "tiff,pdf", .page_name = "ä %{page}"}, origin);
  const MetsListing listing = read_mets(folder / "job/mets.xml");
  EXPECT_EQ(listing.pages, 3u);
  EXPECT_EQ(listing.files.size(), 4u);
  EXPECT_EQ(error_of([&] { check_files(folder / "job", listing); }), "");
  const fs::path page = folder / "job/tiff/ä %2.tif";
  std::string bytes = read_text(page);
  bytes.back() = static_cast<char>(bytes.back() ^ 1);
  test::put(page, bytes);
  EXPECT_THAT(error_of([&] { check_files(folder / "job", listing); }),
              AllOf(HasSubstr("%2.tif"), HasSubstr("checksum")));
  fs::remove(page);
  EXPECT_THAT(error_of([&] { check_files(folder / "job", listing); }), HasSubstr("is not there"));
}

TEST(Deliver, AListingMayNotLeadOutOfItsFolder) {
  const TestFolder folder;
  deliver(some_sources(folder, 1), folder / "job", {.formats = "tiff"}, origin);
  const fs::path mets = folder / "job/mets.xml";
  const std::string text = read_text(mets);
  const std::string name = "tiff/page_0001.tif";
  const std::size_t at = text.find(name);
  for (const char* path : {"../p0.png", "/etc/passwd", "tiff/%2E%2e/../x", ""}) {
    test::put(mets, fmt::format("{}{}{}", text.substr(0, at), path, text.substr(at + name.size())));
    EXPECT_THAT(error_of([&] { read_mets(mets); }), HasSubstr("page_1_tiff: expected a file in this folder")) << path;
  }
  test::put(mets, text.substr(0, text.size() / 2));
  EXPECT_THAT(error_of([&] { read_mets(mets); }), HasSubstr("mets.xml: byte"));
}

TEST(Deliver, GoesOnWhereItWasBrokenOff) {
  const TestFolder folder;
  auto sources = some_sources(folder, 12);  // more than are worked on at a time
  const auto missing = sources[10].picture;
  const std::string bytes = read_text(missing);
  test::put(missing, "no picture");
  const DeliveryOptions options{.formats = "tiff"};
  EXPECT_THAT(error_of([&] { deliver(sources, folder / "job", options, origin); }),
              AllOf(HasSubstr("page 11"), HasSubstr("p10.png")));
  EXPECT_FALSE(fs::exists(folder / "job/mets.xml"));
  test::put(missing, bytes);
  const auto first = fs::last_write_time(folder / "job/tiff/page_0001.tif");
  const Delivery delivery = deliver(sources, folder / "job", options, origin);
  EXPECT_GE(delivery.reused, 8);
  EXPECT_LE(delivery.reused, 11);
  EXPECT_EQ(fs::last_write_time(folder / "job/tiff/page_0001.tif"), first);
  EXPECT_TRUE(fs::exists(folder / "job/mets.xml"));
}

TEST(Deliver, APageThatChangedOrIsWantedOtherwiseIsMadeAnew) {
  const TestFolder folder;
  auto sources = some_sources(folder, 2);
  const auto break_off = [&](const DeliveryOptions& options) {
    fs::remove_all(folder / "job/job.pdf");
    test::put(folder / "job/job.pdf/x", "");  // a folder in the PDF's place
    EXPECT_THAT(error_of([&] { deliver(sources, folder / "job", options, origin); }), HasSubstr("job.pdf"));
    fs::remove_all(folder / "job/job.pdf");
  };
  break_off({});
  write_page(folder, "p1.png", 7);
  EXPECT_EQ(deliver(sources, folder / "job", {}, origin).reused, 1);
  EXPECT_EQ(std::get<0>(read_picture(folder / "job/tiff/page_0002.tif").samples)(0, 0), 7);
  break_off({});
  DeliveryOptions other;
  other.picture.tiff_compression = TiffCompression::lzw;
  EXPECT_EQ(deliver(sources, folder / "job", other, origin).reused, 0);
}

TEST(Deliver, TakesPagesFromResultFoldersByTheirIndex) {
  const TestFolder folder;
  for (const char* name : {"r/page_1_scanmap.tiff", "r/page_2_scanmap.tiff"}) write_bytes(folder / name, "");
  write_page(folder, "r/page_1.png", 1);
  write_page(folder, "r/other.png", 2);
  write_pages_file(folder / "r", {"faust", {{1, "page_1.png", "left"}, {2, "other.png", "right"}}});
  const std::vector<fs::path> results = {folder / "r"};
  const auto pages = find_pages(results);
  ASSERT_EQ(pages.size(), 2u);
  EXPECT_EQ(pages[0].capture + pages[0].side, "faustleft");
  EXPECT_EQ(pages[1].picture.filename(), "other.png");
  fs::create_directory(folder / "empty");
  const std::vector<fs::path> wrong = {folder / "empty"}, absent = {folder / "absent"};
  EXPECT_THAT(error_of([&] { find_pages(wrong); }), HasSubstr("it has no pages"));
  EXPECT_THAT(error_of([&] { find_pages(absent); }), HasSubstr("absent"));
}

TEST(Deliver, RefusesOptionsThatMakeNoSense) {
  const TestFolder folder;
  const auto sources = some_sources(folder, 2);
  EXPECT_THROW(deliver(sources, folder / "job", {.formats = "tiff,gif"}, origin), std::invalid_argument);
  EXPECT_THROW(deliver(sources, folder / "job", {.formats = ""}, origin), std::invalid_argument);
  EXPECT_THROW(deliver(sources, folder / "job", {.page_name = "same"}, origin), std::invalid_argument);
  EXPECT_THROW(deliver({}, folder / "job", {}, origin), std::invalid_argument);
}

TEST(Deliver, RecognisedTextIsInAllThatCanHoldIt) {
  if (!TextRecogniser::is_installed()) GTEST_SKIP() << "tesseract is not installed";
  const TestFolder folder;
  write_picture(folder / "p.png", test::typeset_page("Words stand where they stand.", 3).picture);
  const std::vector<fs::path> page = {folder / "p.png"};
  deliver(find_pages(page), folder / "job", {.ocr = "eng"}, origin);
  const auto alto = load(folder / "job/alto/page_0001.xml");
  std::string text;
  for (const auto& found : alto.select_nodes("//String"))
    text += found.node().attribute("CONTENT").value() + std::string(" ");
  EXPECT_EQ(text, "Words stand where they stand. ");
  EXPECT_THAT(read_text(folder / "job/hocr/page_0001.hocr"), HasSubstr(">Words</span>"));
  EXPECT_THAT(read_text(folder / "job/mets.xml"), HasSubstr("USE=\"FULLTEXT\""));
  EXPECT_EQ(test::StructureCheck(test::alto_rules()).errors_of(alto), "");
  EXPECT_EQ(test::StructureCheck(test::mets_rules()).errors_of(load(folder / "job/mets.xml")), "");
}

/// The structure that the schema of ALTO 4.2 prescribes, as far as our files use it.
TEST(Alto, HasTheStructureOfItsSchema) {
  TextPage page{.width_px = 500, .height_px = 300, .pixels_per_mm = 10, .blocks = {}};
  TextLine line{{10, 20, 90, 40}, 0.01, -5, 22, {{"a", {10, 20, 30, 40}, 0.5}, {"<b>", {50, 20, 90, 40}, 1}}};
  page.blocks = {{{10, 20, 90, 40}, {{{10, 20, 90, 40}, "eng", {line}}, {{10, 20, 90, 40}, "chi_sim", {line}}}}};
  pugi::xml_document document;
  ASSERT_TRUE(
      document.load_string(format_alto(page, {"p.tif", "pagesweep 1", "tesseract 5", "2026-11-22T18:00:00Z"}).c_str()));
  const pugi::xml_node alto = document.child("alto");
  EXPECT_STREQ(alto.attribute("xmlns").value(), "http://www.loc.gov/standards/alto/ns-v4#");
  EXPECT_STREQ(alto.first_child().name(), "Description");
  EXPECT_STREQ(alto.first_child().first_child().name(), "MeasurementUnit");
  EXPECT_STREQ(alto.child("Description").child_value("MeasurementUnit"), "pixel");
  const pugi::xml_node space = alto.child("Layout").child("Page").child("PrintSpace");
  EXPECT_EQ(space.attribute("WIDTH").as_int(), 500);
  std::set<std::string> ids;
  for (const auto& found : document.select_nodes("//*[@ID]"))
    EXPECT_TRUE(ids.insert(found.node().attribute("ID").value()).second);
  EXPECT_EQ(ids.size(), 2u + 2 + 2 + 2 + 4);  // processing; page and space; blocks; lines; words
  const pugi::xml_node block = space.child("TextBlock");
  EXPECT_STREQ(block.attribute("LANG").value(), "eng");
  EXPECT_STREQ(block.child("TextLine").attribute("BASELINE").value(), "10,35 90,35.8");
  std::vector<std::string> children;
  for (const auto& child : block.child("TextLine").children()) children.emplace_back(child.name());
  EXPECT_THAT(children, testing::ElementsAre("String", "SP", "String"));
  EXPECT_STREQ(block.child("TextLine").last_child().attribute("CONTENT").value(), "<b>");
  EXPECT_EQ(block.child("TextLine").child("SP").attribute("WIDTH").as_int(), 20);
}

}  // namespace
}  // namespace pagesweep
