// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pagesweep/base/progress.h"
#include "pagesweep/calibration/calibrate.h"
#include "pagesweep/data/picture.h"

namespace pagesweep::cli {

/// The pictures of one sensor as the command line names them.
struct PictureList {
  std::string sensor;
  std::vector<std::filesystem::path> files;  ///< sorted by name
};

/// "cam1=left/*.png" or "left/*.png".
/// \param sensor  what the sensor is called if the text does not say so; empty: it has to
/// \throws std::invalid_argument  if the text is of another kind
/// \throws Error                  if no file matches
PictureList list_pictures(const std::string& text, const std::string& sensor);

/// Gray values of 8 bit, the highest that the picture's depth allows being 255. Of colours green, the sharpest.
Image<std::uint8_t> gray_of(const Picture& picture);

/// Searches all pictures for the board. Pictures of different sensors show the same pose if they have the same name up
/// to its last dot; where no two names are the same but there are as many of each, the first belongs to the first.
/// \throws Error  if a file cannot be read or differs in size from the sensor's others
CalibrationInput find_boards(const Board& board, const std::vector<PictureList>& cameras, const PictureList* scanner,
                             const DetectionOptions& options, Progress& progress);

}  // namespace pagesweep::cli
