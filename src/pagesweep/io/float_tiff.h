// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <initializer_list>
#include <span>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/data/page.h"

namespace pagesweep {

/// Reads a TIFF of floating point samples (height x width x channels): strips or tiles, interleaved or separate
/// channels, any lossless compression, 32 or 64 bit.
/// \return one image a channel
/// \throws Error  if the file cannot be read, is cut short, or is no such TIFF
std::vector<Image<float>> read_float_tiff(const std::filesystem::path& file);

/// Likewise, with an error if the number of channels is another.
std::vector<Image<float>> read_float_tiff(const std::filesystem::path& file, int channels);

/// Writes channels of one size as an interleaved float32 TIFF, uncompressed: every program reads it.
/// \throws Error  if it cannot be written
/// \throws std::invalid_argument  if there is no channel or their sizes differ
void write_float_tiff(const std::filesystem::path& file, std::span<const ImageView<const float>> channels);
void write_float_tiff(const std::filesystem::path& file, std::initializer_list<ImageView<const float>> channels);

/// A point or vector a pixel: three channels.
Image<Eigen::Vector3f> read_vector_tiff(const std::filesystem::path& file);
void write_vector_tiff(const std::filesystem::path& file, const Image<Eigen::Vector3f>& vectors);

/// Two channels: u, v.
ScanMap read_scan_map(const std::filesystem::path& file);
void write_scan_map(const std::filesystem::path& file, const ScanMap& map);

}  // namespace pagesweep
