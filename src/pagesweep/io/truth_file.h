// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/data/page.h"

namespace pagesweep {

/// What is known of one printed page.
struct TruthPage {
  int index = 1;               ///< from left to right, 1 first
  double pixels_per_mm = 0;    ///< of page_N.png
  int points_subsampling = 1;  ///< page_N_points.tiff has each n-th pixel of page_N.png, in both directions
  std::string text;            ///< file of the printed text, UTF-8; empty: none
};

struct TruthStripe {
  double mm_per_frame = 0;
  double fwhm_mm = 0;  ///< full width at half maximum
};

/// Extension: the sensor model that made the frames.
struct TruthSensor {
  double gain_e_per_gray = 0;  ///< [electrons per gray value]
  double read_noise_gray = 0;  ///< [gray values]
};

/// Extension: light of the stripe over time at one spot, highest value 1: sample k is at start_frames + k step_frames
/// from the moment at which the stripe's middle passes.
struct TruthProfile {
  double start_frames = 0;
  double step_frames = 0;
  std::vector<double> values;
};

/// Reference data of a synthetic capture (docs/formats.md, "Truth").
struct Truth {
  std::filesystem::path folder;  ///< where truth.json lies
  std::vector<TruthPage> pages;
  std::optional<TruthStripe> stripe;
  std::optional<TruthSensor> sensor;
  std::optional<TruthProfile> profile;

  std::filesystem::path camera_points_path(std::string_view camera) const;  ///< cam1_points.tiff
  std::filesystem::path page_path(int index) const;                         ///< page_1.png
  std::filesystem::path page_scan_map_path(int index) const;                ///< page_1_scanmap.tiff
  std::filesystem::path page_points_path(int index) const;                  ///< page_1_points.tiff
};

/// Reads truth.json from its folder or from the file itself.
/// \throws Error  that names file, field and what was expected
Truth read_truth(const std::filesystem::path& folder_or_file);

/// Writes truth.folder / "truth.json".
/// \throws Error  if it cannot be written
void write_truth(const Truth& truth);

/// Rig-frame point [mm] that the centre ray of each pixel of a camera hits; NaN where it hits no page.
Image<Eigen::Vector3f> read_camera_points(const Truth& truth, std::string_view camera);
/// For each pixel of page_N.png the place in the scan; NaN where hidden.
ScanMap read_page_scan_map(const Truth& truth, int index);
/// Rig-frame point [mm] of each points_subsampling-th pixel of page_N.png.
Image<Eigen::Vector3f> read_page_points(const Truth& truth, int index);

}  // namespace pagesweep
