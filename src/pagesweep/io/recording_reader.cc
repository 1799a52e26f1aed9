// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <unordered_set>

#include "pagesweep/base/error.h"
#include "pagesweep/io/file_descriptor_internal.h"
#include "pagesweep/io/recording_file.h"
#include "pagesweep/io/tiff_tags_internal.h"

namespace pagesweep {
namespace {

constexpr std::size_t most_pages = 100'000;  ///< as many as a capture may have frames
constexpr std::uint64_t most_entries = 1000;
constexpr std::uint64_t widest_px = 200'000;

/// The bytes of a TIFF and how numbers stand in it. Nothing is read beyond the end.
///
/// By pread(), not from a memory map: that copies as fast, and a file that is cut short meanwhile, or whose disk fails,
/// is an error here and the end of the process there.
class TiffBytes {
 public:
  explicit TiffBytes(const std::filesystem::path& file) : file_(file), descriptor_(file, O_RDONLY) {
    struct stat status{};
    if (descriptor_.number() < 0 || ::fstat(descriptor_.number(), &status) != 0)
      throw cannot_read(file, message_of(errno));
    if (!S_ISREG(status.st_mode)) throw cannot_read(file, "it is no regular file");
    size_ = static_cast<std::uint64_t>(status.st_size);
    read_order();
  }

  const std::filesystem::path& file() const { return file_; }
  const tiff::Layout& layout() const { return layout_; }
  std::uint64_t size() const { return size_; }
  bool is_swapped() const { return is_swapped_; }
  bool holds(std::uint64_t offset, std::uint64_t bytes) const { return offset <= size_ && bytes <= size_ - offset; }

  /// \param where  for the message: "page 3"
  void read(std::uint64_t offset, std::span<std::byte> out, const std::string& where) const {
    if (!holds(offset, out.size()))
      throw cannot_read(file_, fmt::format("it is cut short: {} goes on at byte {} of {}", where, offset, size_));
    while (!out.empty()) {
      const ssize_t got = ::pread(descriptor_.number(), out.data(), out.size(), static_cast<off_t>(offset));
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) throw cannot_read(file_, fmt::format("{}: {}", where, message_of(errno)));
      if (got == 0) throw cannot_read(file_, fmt::format("{}: the file has become shorter meanwhile", where));
      out = out.subspan(static_cast<std::size_t>(got));
      offset += static_cast<std::uint64_t>(got);
    }
  }

  template <class T>
  T number(std::span<const std::byte> bytes, std::uint64_t at) const {
    std::byte raw[sizeof(T)];
    std::memcpy(raw, bytes.data() + at, sizeof(T));
    if (is_swapped_) std::reverse(std::begin(raw), std::end(raw));
    return std::bit_cast<T>(raw);
  }
  /// A number of `width` bytes.
  std::uint64_t number(std::span<const std::byte> bytes, std::uint64_t at, std::uint64_t width) const {
    switch (width) {
      case 1:
        return static_cast<std::uint64_t>(bytes[at]);
      case 2:
        return number<std::uint16_t>(bytes, at);
      case 4:
        return number<std::uint32_t>(bytes, at);
      default:
        return number<std::uint64_t>(bytes, at);
    }
  }
  std::uint64_t first_directory() const { return first_directory_; }

 private:
  void read_order() {
    std::byte header[tiff::big_layout.header] = {};
    const std::uint64_t bytes = std::min<std::uint64_t>(size_, sizeof(header));
    read(0, std::span(header).first(bytes), "the header");
    const char first = static_cast<char>(header[0]), second = static_cast<char>(header[1]);
    const bool is_little = std::endian::native == std::endian::little;
    is_swapped_ = first == (is_little ? 'M' : 'I');
    const auto version = number<std::uint16_t>(header, 2);
    if (version == tiff::big_layout.version) layout_ = tiff::big_layout;
    if (bytes < layout_.header || first != second || (first != 'I' && first != 'M') || version != layout_.version)
      throw cannot_read(file_, "expected a TIFF, found another file's first bytes");
    first_directory_ = number(header, layout_.header - layout_.offset, layout_.offset);
  }

  std::filesystem::path file_;
  FileDescriptor descriptor_;
  std::uint64_t size_ = 0;
  std::uint64_t first_directory_ = 0;
  tiff::Layout layout_ = tiff::classic_layout;
  bool is_swapped_ = false;
};

/// What a TIFF says about one page.
class Directory {
 public:
  Directory(const TiffBytes& bytes, std::uint64_t offset, std::size_t page)
      : bytes_(bytes), place_(fmt::format("page {}", page)) {
    const tiff::Layout& layout = bytes.layout();
    std::vector<std::byte> buffer(layout.counter);
    bytes.read(offset, buffer, place_);
    const std::uint64_t entries = bytes.number(buffer, 0, layout.counter);
    if (entries > most_entries) throw error(fmt::format("expected up to {} tags, found {}", most_entries, entries));
    buffer.resize(entries * layout.entry + layout.offset);
    bytes.read(offset + layout.counter, buffer, place_);
    for (std::uint64_t k = 0; k < entries; ++k) add_entry(buffer, k * layout.entry, offset + layout.counter);
    next_ = bytes.number(buffer, entries * layout.entry, layout.offset);
  }

  /// Offset of the next page's directory; 0 after the last one.
  std::uint64_t next() const { return next_; }
  Error error(const std::string& problem) const { return bad_input(bytes_.file(), place_, problem); }
  const std::string& place() const { return place_; }

  bool has(tiff::Tag tag) const { return fields_.contains(tag); }
  /// The only or first number of a tag.
  std::uint64_t number(tiff::Tag tag) const { return numbers(tag, 1).front(); }
  std::uint64_t number(tiff::Tag tag, std::uint64_t otherwise) const { return has(tag) ? number(tag) : otherwise; }
  /// The first `count` numbers of a tag.
  std::vector<std::uint64_t> numbers(tiff::Tag tag, std::uint64_t count) const {
    const auto found = fields_.find(tag);
    if (found == fields_.end()) throw error(fmt::format("the tag {} is missing", int{tag}));
    const Field& field = found->second;
    if (field.width == 0) throw error(fmt::format("expected whole numbers in the tag {}", int{tag}));
    if (field.count < count)
      throw error(fmt::format("expected {} numbers in the tag {}, found {}", count, int{tag}, field.count));
    if (!bytes_.holds(field.at, count * field.width))
      throw cannot_read(bytes_.file(), fmt::format("it is cut short: {} has numbers at byte {} of {}", place_, field.at,
                                                   bytes_.size()));
    std::vector<std::byte> buffer(count * field.width);
    bytes_.read(field.at, buffer, place_);
    std::vector<std::uint64_t> values;
    for (std::uint64_t k = 0; k < count; ++k) values.push_back(bytes_.number(buffer, k * field.width, field.width));
    return values;
  }

 private:
  struct Field {
    std::uint64_t width = 0;  ///< of a number [bytes]; 0: no whole numbers
    std::uint64_t count = 0;
    std::uint64_t at = 0;  ///< where in the file they stand
  };

  static std::uint64_t width_of_type(std::uint16_t type) {
    switch (type) {
      case 1:
        return 1;
      case tiff::short_type:
        return 2;
      case tiff::long_type:
        return 4;
      case tiff::long8_type:
        return 8;
      default:
        return 0;
    }
  }

  void add_entry(std::span<const std::byte> entries, std::uint64_t at, std::uint64_t entries_at) {
    const std::uint64_t offset_bytes = bytes_.layout().offset, value = at + 4 + offset_bytes;
    Field field;
    field.width = width_of_type(bytes_.number<std::uint16_t>(entries, at + 2));
    field.count = bytes_.number(entries, at + 4, offset_bytes);
    const bool stands_here = field.width == 0 || field.count <= offset_bytes / field.width;
    field.at = stands_here ? entries_at + value : bytes_.number(entries, value, offset_bytes);
    fields_[bytes_.number<std::uint16_t>(entries, at)] = field;
  }

  const TiffBytes& bytes_;
  std::string place_;
  std::uint64_t next_ = 0;
  std::map<std::uint16_t, Field> fields_;
};

/// How the pixels of a page are stored.
struct PixelFormat {
  std::uint64_t width = 0, height = 0;  ///< [px]
  std::uint64_t bits = 0;               ///< of a sample
  bool operator==(const PixelFormat&) const = default;
  std::uint64_t row_bytes() const { return width * bits / 8; }
  std::uint64_t bytes() const { return height * row_bytes(); }
};

/// Refuses what would have to be decoded or would not be a camera's gray values.
PixelFormat read_pixel_format(const Directory& page) {
  const auto require = [&](bool is_right, const std::string& problem) {
    if (!is_right) throw page.error(problem);
  };
  const auto compression = page.number(tiff::compression, tiff::not_compressed);
  require(compression == tiff::not_compressed,
          fmt::format("expected pixels that are not compressed, found compression {}: unpack them with `tiffcp -c none "
                      "-s`, or store each frame in a file of its own and name these in \"frames\"",
                      compression));
  require(!page.has(tiff::tile_width), "expected strips, found tiles: `tiffcp -c none -s` turns them into strips");
  const auto channels = page.number(tiff::samples_per_pixel, 1);
  require(channels == 1, fmt::format("expected a single gray channel as recorded, found {} channels", channels));
  const auto photometric = page.number(tiff::photometric, tiff::black_is_zero);
  require(photometric == tiff::black_is_zero,
          fmt::format("expected gray where 0 is black (photometric interpretation 1), found {}", photometric));
  const auto format = page.number(tiff::sample_format, tiff::unsigned_samples);
  const PixelFormat pixels{page.number(tiff::image_width), page.number(tiff::image_length),
                           page.number(tiff::bits_per_sample, 1)};
  require(format == tiff::unsigned_samples && (pixels.bits == 8 || pixels.bits == 16),
          fmt::format("expected unsigned samples of 8 or 16 bit, found {} bit{}", pixels.bits,
                      format == tiff::unsigned_samples ? "" : " signed or floating point"));
  require(page.number(tiff::fill_order, tiff::highest_bit_first) == tiff::highest_bit_first,
          "expected bytes whose highest bit comes first, found fill order 2");
  require(pixels.width >= 1 && pixels.height >= 1 && pixels.width <= widest_px && pixels.height <= widest_px,
          fmt::format("expected a picture of at most {0} x {0} pixels, found {1} x {2}", widest_px, pixels.width,
                      pixels.height));
  return pixels;
}

/// Pixels that stand together in the file.
struct Run {
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;
};

/// Adds the places of a page's pixels. Strips that follow each other, as most programs write them, are one run.
void add_runs(const TiffBytes& bytes, const Directory& page, const PixelFormat& format, std::vector<Run>& runs) {
  const std::uint64_t rows = std::min(page.number(tiff::rows_per_strip, format.height), format.height);
  if (rows == 0) throw page.error("expected strips of at least one row");
  const std::uint64_t strips = (format.height + rows - 1) / rows;
  const auto offsets = page.numbers(tiff::strip_offsets, strips);
  const auto counts = page.numbers(tiff::strip_byte_counts, strips);
  const std::size_t first = runs.size();
  for (std::uint64_t k = 0; k < strips; ++k) {
    const std::uint64_t needed = std::min(rows, format.height - k * rows) * format.row_bytes();
    if (counts[k] < needed)
      throw page.error(fmt::format("expected {} bytes in strip {}, found {}", needed, k, counts[k]));
    if (!bytes.holds(offsets[k], needed))
      throw cannot_read(bytes.file(), fmt::format("it is cut short: {} has {} bytes of pixels at byte {} of {}",
                                                  page.place(), needed, offsets[k], bytes.size()));
    if (runs.size() > first && runs.back().offset + runs.back().bytes == offsets[k])
      runs.back().bytes += needed;
    else
      runs.push_back({offsets[k], needed});
  }
}

}  // namespace

struct RecordingReader::Contents {
  TiffBytes bytes;
  PixelFormat format;                 ///< of all pages
  std::vector<Run> runs;              ///< of all pages, one after the other
  std::vector<std::size_t> run_ends;  ///< one a page

  Contents(const std::filesystem::path& file, std::optional<ImageSize> expected) : bytes(file) {
    std::unordered_set<std::uint64_t> seen;
    for (std::uint64_t at = bytes.first_directory(); at != 0;) {
      const Directory page(bytes, at, run_ends.size());
      if (!seen.insert(at).second)
        throw page.error("it is an earlier page once more: the pages follow each other in a circle");
      if (run_ends.size() == most_pages) throw page.error(fmt::format("expected up to {} pages", most_pages));
      add_page(page, expected);
      at = page.next();
    }
    if (run_ends.empty()) throw bad_input(file, "", "it holds no page");
  }

  void add_page(const Directory& page, std::optional<ImageSize> expected) {
    const PixelFormat found = read_pixel_format(page);
    if (run_ends.empty()) {
      format = found;
      if (expected && (found.width != static_cast<std::uint64_t>(expected->width) ||
                       found.height != static_cast<std::uint64_t>(expected->height)))
        throw page.error(fmt::format("expected {} x {} pixels as in the rig, found {} x {}", expected->width,
                                     expected->height, found.width, found.height));
    }
    if (found != format)
      throw page.error(fmt::format("expected {} x {} pixels of {} bit as on page 0, found {} x {} of {} bit",
                                   format.width, format.height, format.bits, found.width, found.height, found.bits));
    // Otherwise a small file whose pages share their pixels would fill the memory.
    if ((run_ends.size() + 1) * format.bytes() > bytes.size())
      throw cannot_read(bytes.file(), fmt::format("it is cut short: its {} bytes cannot hold {} pages of {} bytes",
                                                  bytes.size(), run_ends.size() + 1, format.bytes()));
    add_runs(bytes, page, format, runs);
    run_ends.push_back(runs.size());
  }

  std::span<const Run> runs_of(int page) const {
    const auto k = static_cast<std::size_t>(page);
    const std::size_t begin = k == 0 ? 0 : run_ends[k - 1];
    return std::span(runs).subspan(begin, run_ends[k] - begin);
  }

  template <class T>
  Image<T> read(int page) const {
    Image<T> image(static_cast<int>(format.width), static_cast<int>(format.height));
    auto out = std::as_writable_bytes(image.pixels());
    for (const Run& run : runs_of(page)) {
      bytes.read(run.offset, out.first(run.bytes), fmt::format("page {}", page));
      out = out.subspan(run.bytes);
    }
    if (sizeof(T) == 2 && bytes.is_swapped())
      for (T& gray : image.pixels()) gray = static_cast<T>(gray << 8 | gray >> 8);
    return image;
  }
};

RecordingReader::RecordingReader(const std::filesystem::path& file, std::optional<ImageSize> expected)
    : contents_(std::make_unique<const Contents>(file, expected)) {}

RecordingReader::~RecordingReader() = default;

int RecordingReader::pages() const { return static_cast<int>(contents_->run_ends.size()); }

ImageSize RecordingReader::size() const {
  return {static_cast<int>(contents_->format.width), static_cast<int>(contents_->format.height)};
}

int RecordingReader::sample_bits() const { return static_cast<int>(contents_->format.bits); }

GrayImage RecordingReader::read(int page) const {
  if (page < 0 || page >= pages()) throw std::invalid_argument("RecordingReader::read: there is no such page");
  if (sample_bits() == 8) return contents_->read<std::uint8_t>(page);
  return contents_->read<std::uint16_t>(page);
}

}  // namespace pagesweep
