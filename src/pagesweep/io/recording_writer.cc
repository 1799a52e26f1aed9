// SPDX-License-Identifier: Apache-2.0
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <span>
#include <stdexcept>
#include <vector>

#include "pagesweep/base/error.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/file_descriptor_internal.h"
#include "pagesweep/io/recording_file.h"
#include "pagesweep/io/tiff_tags_internal.h"

namespace pagesweep {
namespace {

constexpr std::uint64_t alignment = 64;  ///< of pixels and directories: whole cache lines
constexpr std::uint64_t entry_count = 9;
constexpr std::uint64_t classic_end = std::uint64_t{1} << 32;  ///< where 32 bit offsets end

std::uint64_t aligned(std::uint64_t bytes) { return (bytes + alignment - 1) / alignment * alignment; }

/// Numbers one after the other, in the machine's own byte order, which the header tells.
class Bytes {
 public:
  template <class T>
  Bytes& add(T number) {
    const std::size_t at = bytes_.size();
    bytes_.resize(at + sizeof(T));
    std::memcpy(bytes_.data() + at, &number, sizeof(T));
    return *this;
  }
  void pad_to(std::uint64_t size) { bytes_.resize(size); }
  std::span<const std::byte> all() const { return bytes_; }

 private:
  std::vector<std::byte> bytes_;
};

}  // namespace

/// The file is a header, and for each frame its pixels and then its directory. All lengths are known beforehand, so a
/// directory names the next one before that is written, and the file only ever grows at its end.
struct RecordingWriter::State {
  AtomicFile output;
  FileDescriptor descriptor;
  ImageSize size;
  int sample_bits;
  int most_frames;
  int frames = 0;
  tiff::Layout layout = tiff::classic_layout;

  State(const std::filesystem::path& file, ImageSize frame_size, int bits, int most)
      : output(file), descriptor(output.temporary(), O_WRONLY), size(frame_size), sample_bits(bits), most_frames(most) {
    if (pixels_at(most_frames) > classic_end) layout = tiff::big_layout;
    if (descriptor.number() < 0) throw cannot_write(file, message_of(errno));
  }

  bool is_big() const { return layout.offset == 8; }
  std::uint64_t pixel_bytes() const {
    return static_cast<std::uint64_t>(size.width) * static_cast<std::uint64_t>(size.height) *
           static_cast<std::uint64_t>(sample_bits / 8);
  }
  std::uint64_t directory_bytes() const { return aligned(layout.counter + entry_count * layout.entry + layout.offset); }
  std::uint64_t pixels_at(int frame) const {
    return aligned(layout.header) + static_cast<std::uint64_t>(frame) * (aligned(pixel_bytes()) + directory_bytes());
  }
  std::uint64_t directory_at(int frame) const { return pixels_at(frame) + aligned(pixel_bytes()); }

  void add_offset(Bytes& bytes, std::uint64_t offset) const {
    if (is_big())
      bytes.add(offset);
    else
      bytes.add(static_cast<std::uint32_t>(offset));
  }
  void add_entry(Bytes& bytes, tiff::Tag tag, tiff::Type type, std::uint64_t value) const;
  void write(std::span<const std::byte> bytes) const {
    if (!descriptor.write(bytes)) throw cannot_write(output.target(), message_of(errno));
  }
  /// Takes back what was written after the last whole frame, so that a full disk has room for the end of the file.
  void take_back() const {
    const std::uint64_t end = frames == 0 ? pixels_at(0) : directory_at(frames - 1);
    if (::ftruncate(descriptor.number(), static_cast<off_t>(end)) == 0)
      ::lseek(descriptor.number(), static_cast<off_t>(end), SEEK_SET);
  }
  void write_header() const;
  void write_directory(int frame, bool is_last) const;
};

/// One number, which stands in the entry itself, at the left of its place if it is shorter.
void RecordingWriter::State::add_entry(Bytes& bytes, tiff::Tag tag, tiff::Type type, std::uint64_t value) const {
  const std::size_t end = bytes.all().size() + layout.entry;
  bytes.add<std::uint16_t>(tag).add<std::uint16_t>(type);
  add_offset(bytes, 1);
  if (type == tiff::short_type)
    bytes.add(static_cast<std::uint16_t>(value));
  else if (type == tiff::long_type)
    bytes.add(static_cast<std::uint32_t>(value));
  else
    bytes.add(value);
  bytes.pad_to(end);
}

void RecordingWriter::State::write_header() const {
  Bytes header;
  const char order = std::endian::native == std::endian::little ? 'I' : 'M';
  header.add(order).add(order).add(layout.version);
  if (is_big()) header.add(static_cast<std::uint16_t>(layout.offset)).add<std::uint16_t>(0);
  add_offset(header, directory_at(0));
  header.pad_to(pixels_at(0));
  write(header.all());
}

void RecordingWriter::State::write_directory(int frame, bool is_last) const {
  const auto [width, height] =
      std::pair(static_cast<std::uint64_t>(size.width), static_cast<std::uint64_t>(size.height));
  const tiff::Type offset_type = is_big() ? tiff::long8_type : tiff::long_type;
  Bytes directory;
  if (is_big())
    directory.add(entry_count);
  else
    directory.add(static_cast<std::uint16_t>(entry_count));
  add_entry(directory, tiff::image_width, tiff::long_type, width);
  add_entry(directory, tiff::image_length, tiff::long_type, height);
  add_entry(directory, tiff::bits_per_sample, tiff::short_type, static_cast<std::uint64_t>(sample_bits));
  add_entry(directory, tiff::compression, tiff::short_type, tiff::not_compressed);
  add_entry(directory, tiff::photometric, tiff::short_type, tiff::black_is_zero);
  add_entry(directory, tiff::strip_offsets, offset_type, pixels_at(frame));
  add_entry(directory, tiff::samples_per_pixel, tiff::short_type, 1);
  add_entry(directory, tiff::rows_per_strip, tiff::long_type, height);
  add_entry(directory, tiff::strip_byte_counts, offset_type, pixel_bytes());
  add_offset(directory, is_last ? 0 : directory_at(frame + 1));
  directory.pad_to(directory_bytes());
  write(directory.all());
}

RecordingWriter::RecordingWriter(const std::filesystem::path& file, ImageSize size, int sample_bits, int most_frames) {
  if (size.width < 1 || size.height < 1 || (sample_bits != 8 && sample_bits != 16) || most_frames < 1)
    throw std::invalid_argument("RecordingWriter: there are no such frames");
  state_ = std::make_unique<State>(file, size, sample_bits, most_frames);
  state_->write_header();
}

RecordingWriter::~RecordingWriter() = default;

void RecordingWriter::append(const GrayImage& frame) {
  State& state = *state_;
  const int bits = frame.index() == 0 ? 8 : 16;
  if (width_of(frame) != state.size.width || height_of(frame) != state.size.height || bits != state.sample_bits)
    throw std::invalid_argument("RecordingWriter::append: the frame's size or depth is not the recording's");
  if (state.frames == state.most_frames) throw std::invalid_argument("RecordingWriter::append: more than most_frames");
  try {
    if (state.frames > 0) state.write_directory(state.frames - 1, false);
    std::visit([&](const auto& image) { state.write(std::as_bytes(image.pixels())); }, frame);
    const std::vector<std::byte> padding(aligned(state.pixel_bytes()) - state.pixel_bytes());
    state.write(padding);
  } catch (const Error&) {
    state.take_back();
    throw;
  }
  ++state.frames;
}

void RecordingWriter::commit() {
  State& state = *state_;
  if (state.frames == 0) throw std::invalid_argument("RecordingWriter::commit: there is no frame");
  state.write_directory(state.frames - 1, true);
  if (!state.descriptor.close()) throw cannot_write(state.output.target(), message_of(errno));
  state.output.commit();
}

void write_gray_tiff(const std::filesystem::path& file, const GrayImage& image) {
  RecordingWriter writer(file, {width_of(image), height_of(image)}, image.index() == 0 ? 8 : 16, 1);
  writer.append(image);
  writer.commit();
}

}  // namespace pagesweep
