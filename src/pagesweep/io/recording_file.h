// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "pagesweep/data/frames.h"
#include "pagesweep/io/image_file.h"

namespace pagesweep {

/// The frames of one camera in one file, to be read without decoding: an uncompressed TIFF, a page a frame, pages
/// counted from 0 (docs/formats.md, "Recording"). Made by RecordingWriter or by another program: strips of any height,
/// either byte order, TIFF or BigTIFF.
class RecordingReader {
 public:
  /// Checks all pages, and reads no pixel yet.
  /// \param expected  another size is an error; without it all pages have to be as large as the first one
  /// \throws Error  if the file cannot be read or is cut short, or a page is compressed, not gray, not of 8 or 16 bit,
  /// or
  ///                unlike the others
  explicit RecordingReader(const std::filesystem::path& file, std::optional<ImageSize> expected = std::nullopt);
  ~RecordingReader();
  RecordingReader(const RecordingReader&) = delete;
  RecordingReader& operator=(const RecordingReader&) = delete;

  int pages() const;
  ImageSize size() const;
  int sample_bits() const;  ///< 8 or 16

  /// The pixels of a page: one copy, from where the system keeps the file into the image. May be called from several
  /// threads at a time.
  /// \throws Error  if the file has been cut short meanwhile, or its disk fails
  /// \throws std::invalid_argument  if there is no such page
  GrayImage read(int page) const;

 private:
  struct Contents;
  std::unique_ptr<const Contents> contents_;
};

/// Writes a recording as the frames come, one after the other and never back, so that a live capture can be stored. The
/// file takes its name with commit(); without it nothing is left behind.
class RecordingWriter {
 public:
  /// \param sample_bits  8 or 16
  /// \param most_frames  that will ever be appended: whether they fit into a TIFF of 4 GB or need a BigTIFF
  /// \throws Error  if it cannot be written there
  /// \throws std::invalid_argument  if there can be no such frame
  RecordingWriter(const std::filesystem::path& file, ImageSize size, int sample_bits, int most_frames);
  ~RecordingWriter();
  RecordingWriter(const RecordingWriter&) = delete;
  RecordingWriter& operator=(const RecordingWriter&) = delete;

  /// The next page.
  /// \throws Error  if it cannot be written; the pages before it can still be committed
  /// \throws std::invalid_argument  if its size or depth is another, or there are most_frames already
  void append(const GrayImage& frame);
  /// To be called after the last frame, of which there must be one at least.
  /// \throws Error  if the file cannot be finished or cannot take its name
  void commit();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Writes a single frame as an uncompressed TIFF.
/// \throws Error  if it cannot be written
void write_gray_tiff(const std::filesystem::path& file, const GrayImage& image);

}  // namespace pagesweep
