// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <string_view>

#include "pagesweep/base/enum_names.h"
#include "pagesweep/base/progress.h"
#include "pagesweep/io/capture_file.h"

namespace pagesweep {

/// How the frames of a capture are stored, always without loss.
enum class FrameFormat {
  recording,  ///< one file a camera that needs no decoding, see RecordingReader
  png,        ///< a file a frame, packed
  tiff,       ///< a file a frame, not packed
};
constexpr auto names_of(FrameFormat) { return std::array<std::string_view, 3>{"recording", "png", "tiff"}; }

struct ConvertOptions {
  FrameFormat format = FrameFormat::recording;
  double drop = 0;
  double lose = 0;
  int seed = 1;
  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("format", format, "", "one file a camera that needs no decoding, or one file a frame");
    visit("drop", drop, "", "share of each camera's frames to leave out, at random: what a poor cable would do");
    visit("lose", lose, "", "share of the triggers to leave out for all cameras: their times alone will tell");
    visit("seed", seed, "", "of what is left out");
  }
};

/// Copies a capture into a folder of its own, with its frames in another format: gray values, dropped frames, exposures
/// and notes stay what they are. Rig, scan and the reference data in truth/ are copied byte by byte. capture.json is
/// written last. Unless frames are to be left out, nothing is lost.
/// \param frames  open_capture() of it; it is read to its end
/// \param folder  is made if it is missing
/// \return  the copy
/// \throws Error  if the folder holds anything, a file cannot be read, or one cannot be written
Capture convert_capture(const Capture& capture, FrameSource& frames, const std::filesystem::path& folder,
                        const ConvertOptions& options = {}, Progress& progress = no_progress());

}  // namespace pagesweep
