// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "pagesweep/base/enum_names.h"
#include "pagesweep/camera/rig.h"

namespace pagesweep {

/// Files of other programs that hold calibrated cameras.
enum class RigFormat {
  automatic,      ///< told by names and contents
  opencv,         ///< see read_opencv_rig(), write_opencv_rig()
  opencv_stereo,  ///< intrinsics.yml and extrinsics.yml, see write_opencv_stereo()
  colmap,         ///< see colmap_rig.h
  kalibr,         ///< see kalibr_rig.h
};
constexpr auto names_of(RigFormat) {
  return std::array<std::string_view, 5>{"auto", "opencv", "opencv-stereo", "colmap", "kalibr"};
}

struct RigConversionOptions {
  RigFormat format = RigFormat::automatic;
  std::string unit = "mm";
  std::string image_size = {};
  std::string names = {};

  /// \see base/options.h
  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("format", format, "", "of the other program; auto: told by names and contents");
    visit("unit", unit, "",
          "unit of lengths in files of OpenCV and COLMAP: mm, cm, m or a number of millimetres; Kalibr's are metres");
    visit("image-size", image_size, "", "size of the cameras' pictures, 1024x768, for OpenCV files without it");
    visit("names", names, "", "names for the imported cameras, cam1,cam2, in place of those in the files");
  }
};

/// Makes a rig of files that another program wrote.
/// \param inputs  the file or files, or the folder that holds them
/// \throws Error                  that names file, place and what was expected
/// \throws std::invalid_argument  if an option says something that cannot be meant
Rig import_rig(std::span<const std::filesystem::path> inputs, const RigConversionOptions& options = {});

/// Writes a rig's cameras for another program, whole or not at all.
/// \param output  a file; a folder for opencv-stereo and colmap
/// \return  the format, if it was to be told by the name: *camchain*.yaml is Kalibr's, other YAML OpenCV's
/// \throws Error                  if it cannot be written, or the format cannot hold the cameras
/// \throws std::invalid_argument  if an option says something that cannot be meant
RigFormat export_rig(const std::filesystem::path& output, const Rig& rig, const RigConversionOptions& options = {});

/// What a rig has that no other program's file holds: "scanner, light"; empty: nothing.
std::string lost_by_export(const Rig& rig);

}  // namespace pagesweep
