// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/recording_file.h"

#include <tiffio.h>

#include <bit>
#include <cstring>
#include <functional>

#include "pagesweep/base/parallel.h"
#include "pagesweep/io/files_testing.h"

namespace pagesweep {
namespace {

using test::error_of;
using test::TestFolder;
using testing::AllOf;
using testing::HasSubstr;

constexpr int width = 13, height = 7;  // odd: pages need padding

template <class T>
Image<T> frame_of(int i) {
  Image<T> image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) image(x, y) = static_cast<T>(1000 * i + 17 * y + x);
  return image;
}

template <class T>
void expect_frame(const GrayImage& found, int i) {
  ASSERT_TRUE(std::holds_alternative<Image<T>>(found));
  EXPECT_TRUE(std::ranges::equal(std::get<Image<T>>(found).pixels(), frame_of<T>(i).pixels())) << "frame " << i;
}

template <class T>
void write_recording(const std::filesystem::path& file, int frames, int most_frames) {
  RecordingWriter writer(file, {width, height}, 8 * sizeof(T), most_frames);
  for (int i = 0; i < frames; ++i) writer.append(frame_of<T>(i));
  writer.commit();
}

/// A multi-page file as libtiff writes it: the independent witness.
/// \param mode  "w", and b: big-endian, l: little-endian, 8: BigTIFF
/// \param change  sets further tags of page i
template <class T>
void write_with_libtiff(
    const std::filesystem::path& file, const char* mode, int frames, int rows_per_strip,
    const std::function<void(TIFF*, int)>& change = [](TIFF*, int) {}) {
  TIFF* tiff = TIFFOpen(file.c_str(), mode);
  ASSERT_TRUE(tiff);
  for (int i = 0; i < frames; ++i) {
    TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, width);
    TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, height);
    TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 8 * sizeof(T));
    TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
    TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
    TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, rows_per_strip);
    change(tiff, i);
    Image<T> image = frame_of<T>(i);
    for (int y = 0; y < height; ++y) TIFFWriteScanline(tiff, image.row(y).data(), static_cast<std::uint32_t>(y), 0);
    TIFFWriteDirectory(tiff);
  }
  TIFFClose(tiff);
}

template <class T>
class RecordingFile : public testing::Test {};
using Depths = testing::Types<std::uint8_t, std::uint16_t>;
TYPED_TEST_SUITE(RecordingFile, Depths);

TYPED_TEST(RecordingFile, KeepsEveryFrame) {
  const TestFolder folder;
  for (const int most_frames : {5, 50'000'000}) {  // the latter needs a BigTIFF
    write_recording<TypeParam>(folder / "cam1.tiff", 5, most_frames);
    const RecordingReader reader(folder / "cam1.tiff", ImageSize{width, height});
    ASSERT_EQ(reader.pages(), 5);
    EXPECT_EQ(reader.sample_bits(), 8 * static_cast<int>(sizeof(TypeParam)));
    EXPECT_EQ(reader.size().width, width);
    EXPECT_EQ(reader.size().height, height);
    for (const int i : {4, 0, 3, 1, 2}) expect_frame<TypeParam>(reader.read(i), i);
    EXPECT_THROW(reader.read(5), std::invalid_argument);
    EXPECT_THROW(reader.read(-1), std::invalid_argument);
  }
}

TYPED_TEST(RecordingFile, IsReadByLibtiffPageByPage) {
  const TestFolder folder;
  for (const int most_frames : {3, 50'000'000}) {
    write_recording<TypeParam>(folder / "cam1.tiff", 3, most_frames);
    TIFF* tiff = TIFFOpen((folder / "cam1.tiff").c_str(), "r");
    ASSERT_TRUE(tiff);
    EXPECT_EQ(TIFFIsBigTIFF(tiff) != 0, most_frames > 3);
    EXPECT_EQ(TIFFNumberOfDirectories(tiff), 3u);
    for (int i = 0; i < 3; ++i) {
      ASSERT_TRUE(TIFFSetDirectory(tiff, static_cast<tdir_t>(i)));
      Image<TypeParam> image(width, height);
      const auto bytes = static_cast<tmsize_t>(image.size() * sizeof(TypeParam));
      EXPECT_EQ(TIFFReadEncodedStrip(tiff, 0, image.data(), bytes), bytes);
      expect_frame<TypeParam>(GrayImage(std::move(image)), i);
    }
    TIFFClose(tiff);
  }
}

TYPED_TEST(RecordingFile, IsReadAsOtherProgramsWriteIt) {
  const TestFolder folder;
  for (const char* mode : {"wl", "wb", "wl8", "wb8"})
    for (const int rows_per_strip : {1, 2, height, 100}) {
      write_with_libtiff<TypeParam>(folder / "cam1.tiff", mode, 3, rows_per_strip);
      const RecordingReader reader(folder / "cam1.tiff");
      ASSERT_EQ(reader.pages(), 3) << mode;
      for (int i = 0; i < 3; ++i) expect_frame<TypeParam>(reader.read(i), i);
    }
}

TYPED_TEST(RecordingFile, IsReadByManyThreads) {
  const TestFolder folder;
  write_recording<TypeParam>(folder / "cam1.tiff", 64, 64);
  const RecordingReader reader(folder / "cam1.tiff");
  std::vector<GrayImage> images(64);
  parallel_rows(64, [&](int i) { images[static_cast<std::size_t>(i)] = reader.read(i); });
  for (int i = 0; i < 64; ++i) expect_frame<TypeParam>(images[static_cast<std::size_t>(i)], i);
}

TEST(RecordingWriter, LeavesNothingBehindWithoutCommit) {
  const TestFolder folder;
  {
    RecordingWriter writer(folder / "cam1.tiff", {width, height}, 8, 3);
    writer.append(frame_of<std::uint8_t>(0));
    EXPECT_FALSE(std::filesystem::exists(folder / "cam1.tiff"));
  }
  EXPECT_EQ(folder.files(), 0u);
}

TEST(RecordingWriter, RefusesWhatWasNotAnnounced) {
  const TestFolder folder;
  EXPECT_THROW(RecordingWriter(folder / "a.tiff", {0, height}, 8, 3), std::invalid_argument);
  EXPECT_THROW(RecordingWriter(folder / "a.tiff", {width, height}, 12, 3), std::invalid_argument);
  RecordingWriter writer(folder / "a.tiff", {width, height}, 8, 1);
  EXPECT_THROW(writer.commit(), std::invalid_argument);
  EXPECT_THROW(writer.append(frame_of<std::uint16_t>(0)), std::invalid_argument);
  EXPECT_THROW(writer.append(Image<std::uint8_t>(width, height + 1)), std::invalid_argument);
  writer.append(frame_of<std::uint8_t>(0));
  EXPECT_THROW(writer.append(frame_of<std::uint8_t>(1)), std::invalid_argument);
}

TEST(RecordingWriter, WritesASingleFrameAsAPlainTiff) {
  const TestFolder folder;
  write_gray_tiff(folder / "1.tif", frame_of<std::uint16_t>(1));
  expect_frame<std::uint16_t>(read_gray(folder / "1.tif"), 1);
}

TEST(RecordingReader, RefusesPagesThatWouldHaveToBeDecodedOrAreNoFrames) {
  const TestFolder folder;
  const auto file = folder / "cam1.tiff";
  struct Case {
    std::function<void(TIFF*)> change;
    std::string hint;
  };
  const auto set = [](std::uint32_t tag, auto value) { return [=](TIFF* tiff) { TIFFSetField(tiff, tag, value); }; };
  const Case cases[] = {
      {set(TIFFTAG_COMPRESSION, COMPRESSION_LZW), "found compression 5: unpack them with `tiffcp -c none -s`"},
      {set(TIFFTAG_COMPRESSION, COMPRESSION_ADOBE_DEFLATE), "not compressed, found compression 8"},
      {set(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISWHITE), "gray where 0 is black"},
      {set(TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_INT), "found 8 bit signed or floating point"},
      {set(TIFFTAG_BITSPERSAMPLE, 4), "of 8 or 16 bit, found 4 bit"},
      {set(TIFFTAG_FILLORDER, FILLORDER_LSB2MSB), "fill order 2"},
      {set(TIFFTAG_IMAGEWIDTH, width - 1), "expected 13 x 7 pixels of 8 bit as on page 0, found 12 x 7"},
  };
  for (const Case& damage : cases) {
    write_with_libtiff<std::uint8_t>(file, "w", 4, height, [&](TIFF* tiff, int i) {
      if (i == 2) damage.change(tiff);
    });
    EXPECT_THAT(error_of([&] { RecordingReader reader(file); }),
                AllOf(HasSubstr(file.string() + ": page 2: "), HasSubstr(damage.hint)));
  }
  write_recording<std::uint8_t>(file, 2, 2);
  EXPECT_THAT(error_of([&] { RecordingReader reader(file, ImageSize{width, 8}); }),
              AllOf(HasSubstr("page 0: "), HasSubstr("expected 13 x 8 pixels as in the rig, found 13 x 7")));
}

TEST(RecordingReader, RefusesTiles) {
  const TestFolder folder;
  TIFF* tiff = TIFFOpen((folder / "cam1.tiff").c_str(), "w");
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, 16);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, 16);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 8);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
  TIFFSetField(tiff, TIFFTAG_TILEWIDTH, 16);
  TIFFSetField(tiff, TIFFTAG_TILELENGTH, 16);
  Image<std::uint8_t> tile(16, 16);
  TIFFWriteEncodedTile(tiff, 0, tile.data(), 256);
  TIFFClose(tiff);
  EXPECT_THAT(error_of([&] { RecordingReader reader(folder / "cam1.tiff"); }), HasSubstr("found tiles"));
}

/// A recording whose numbers can be changed, of five frames in the machine's byte order.
class Damaged {
 public:
  using Changes = std::vector<std::pair<std::size_t, std::uint32_t>>;  ///< where, what
  explicit Damaged(const TestFolder& folder) : file_(folder / "cam1.tiff") {
    write_recording<std::uint8_t>(file_, 5, 5);
    bytes_ = test::read_text(file_);
  }
  std::uint32_t number(std::size_t at) const {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes_.data() + at, 4);
    return value;
  }
  /// Where a page's directory stands.
  std::size_t directory(int page) const {
    std::size_t at = number(4);
    for (int i = 0; i < page; ++i) at = number(next(at));
    return at;
  }
  std::size_t value_of(int page, std::uint16_t tag) const {
    for (std::size_t at = directory(page) + 2;; at += 12)
      if (std::memcmp(bytes_.data() + at, &tag, 2) == 0) return at + 8;
  }
  std::size_t count_of(int page, std::uint16_t tag) const { return value_of(page, tag) - 4; }
  std::size_t next_of(int page) const { return next(directory(page)); }
  std::size_t size() const { return bytes_.size(); }

  /// The error of reading it with numbers changed, or up to `length` only.
  std::string error_with(std::size_t at, std::uint32_t value) const { return error_with({{at, value}}); }
  std::string error_with(const Changes& changes) const {
    std::string changed = bytes_;
    for (const auto& [at, value] : changes) std::memcpy(changed.data() + at, &value, 4);
    return error_of_bytes(changed);
  }
  std::string error_when_cut(std::size_t length) const { return error_of_bytes(bytes_.substr(0, length)); }

 private:
  std::size_t next(std::size_t directory) const {
    std::uint16_t entries = 0;
    std::memcpy(&entries, bytes_.data() + directory, 2);
    return directory + 2 + 12 * std::size_t{entries};
  }
  std::string error_of_bytes(const std::string& bytes) const {
    test::put(file_, bytes);
    return error_of([&] {
      const RecordingReader reader(file_);
      for (int i = 0; i < reader.pages(); ++i) reader.read(i);
    });
  }

  std::filesystem::path file_;
  std::string bytes_;
};

TEST(RecordingReader, RefusesOffsetsAndLengthsThatLeaveTheFile) {
  const TestFolder folder;
  const Damaged recording(folder);
  const auto end = static_cast<std::uint32_t>(recording.size());
  for (const std::uint32_t offset : {end, end - 1, end - width * height + 1, 0x7fffffffU, 0xffffffffU}) {
    EXPECT_THAT(recording.error_with(recording.value_of(3, TIFFTAG_STRIPOFFSETS), offset),
                AllOf(HasSubstr("cam1.tiff: cannot be read: it is cut short"), HasSubstr("page 3")))
        << offset;
    if (offset + 100 < end) continue;  // as a directory it would begin in the last page
    EXPECT_THAT(recording.error_with(recording.next_of(1), offset), AllOf(HasSubstr("page 2"), HasSubstr("cut short")));
  }
  EXPECT_THAT(recording.error_with(recording.value_of(1, TIFFTAG_STRIPBYTECOUNTS), 90),
              HasSubstr("page 1: expected 91 bytes in strip 0, found 90"));
  EXPECT_THAT(recording.error_with(recording.count_of(1, TIFFTAG_STRIPOFFSETS), 0),
              HasSubstr("page 1: expected 1 num"));
  EXPECT_THAT(recording.error_with(recording.count_of(1, TIFFTAG_STRIPOFFSETS), 0xffffffffU), HasSubstr("page 1"));
  EXPECT_THAT(recording.error_with(4, 0), HasSubstr("it holds no page"));
  EXPECT_THAT(recording.error_with(4, end), HasSubstr("page 0"));
  EXPECT_THAT(recording.error_with(0, 0), HasSubstr("expected a TIFF"));
}

TEST(RecordingReader, RefusesSizesThatOverflowOrThatTheFileCannotHold) {
  const TestFolder folder;
  const Damaged recording(folder);
  for (const auto tag : {TIFFTAG_IMAGEWIDTH, TIFFTAG_IMAGELENGTH})
    for (const std::uint32_t size : {0U, 0x80000000U, 0xffffffffU})
      EXPECT_THAT(recording.error_with(recording.value_of(0, static_cast<std::uint16_t>(tag)), size),
                  HasSubstr("page 0: expected a picture of at most"));
  EXPECT_THAT(recording.error_with(recording.value_of(0, TIFFTAG_IMAGEWIDTH), 150'000),
              HasSubstr("cannot hold 1 pages"));
  EXPECT_THAT(recording.error_with(recording.value_of(1, TIFFTAG_ROWSPERSTRIP), 0), HasSubstr("at least one row"));
}

TEST(RecordingReader, RefusesPagesThatGoRoundInACircle) {
  const TestFolder folder;
  const Damaged recording(folder);
  for (int page = 0; page < 5; ++page)
    for (int back = 0; back <= page; ++back)
      EXPECT_THAT(recording.error_with(recording.next_of(page), static_cast<std::uint32_t>(recording.directory(back))),
                  HasSubstr("in a circle"))
          << page << " " << back;
}

TEST(RecordingReader, RefusesAFileThatIsCutShortAnywhere) {
  const TestFolder folder;
  const Damaged recording(folder);
  const std::size_t last = recording.next_of(4) + 4;  // what follows is padding
  for (std::size_t length = 0; length < last; ++length)
    EXPECT_THAT(recording.error_when_cut(length), HasSubstr("cam1.tiff: ")) << length;
  EXPECT_EQ(recording.error_when_cut(last), "");
}

TEST(RecordingReader, RefusesPagesThatShareTheirPixels) {
  const TestFolder folder;
  const Damaged recording(folder);
  Damaged::Changes changes;
  constexpr std::uint32_t rows = 30, begin = 64;
  for (int page = 0; page < 5; ++page) {
    changes.emplace_back(recording.value_of(page, TIFFTAG_IMAGELENGTH), rows);
    changes.emplace_back(recording.value_of(page, TIFFTAG_ROWSPERSTRIP), rows);
    changes.emplace_back(recording.value_of(page, TIFFTAG_STRIPBYTECOUNTS), rows * width);
    changes.emplace_back(recording.value_of(page, TIFFTAG_STRIPOFFSETS), begin);
  }
  // Each page alone is sound; together they would be more than the file, and a small one could fill the memory.
  EXPECT_THAT(recording.error_with(changes), HasSubstr("cannot hold 4 pages of 390 bytes"));
}

TEST(RecordingReader, ReportsAFileThatShrinksWhileItIsRead) {
  const TestFolder folder;
  write_recording<std::uint8_t>(folder / "cam1.tiff", 5, 5);
  const RecordingReader reader(folder / "cam1.tiff");
  std::filesystem::resize_file(folder / "cam1.tiff", 1000);
  EXPECT_THAT(error_of([&] { reader.read(4); }), AllOf(HasSubstr("page 4"), HasSubstr("shorter meanwhile")));
}

TEST(RecordingReader, RefusesWhatIsNoFile) {
  const TestFolder folder;
  EXPECT_THAT(error_of([&] { RecordingReader reader(folder / "nowhere.tiff"); }),
              HasSubstr("nowhere.tiff: cannot be r"));
  EXPECT_THAT(error_of([&] { RecordingReader reader(folder.path()); }), HasSubstr("no regular file"));
}

}  // namespace
}  // namespace pagesweep
