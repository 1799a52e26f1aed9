// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "pagesweep/data/page.h"

namespace pagesweep {

/// Place in the scan of a page position, bilinear between the four pixels around it.
/// \param pixel  [px] of the page
/// \return  [px] of the scan; nothing outside the map or beside a hidden pixel
std::optional<Eigen::Vector2d> scan_position(const ScanMap& map, const Eigen::Vector2d& pixel);

/// The way back through a scan map: which page position is imaged at a place in the scan. Newton's method on the
/// bilinear map, from the nearest of a coarse grid of pixels.
class ScanMapInverse {
 public:
  /// Keeps a reference to the map.
  explicit ScanMapInverse(const ScanMap& map);
  ScanMapInverse(ScanMap&&) = delete;

  /// \param scan   [px]
  /// \return  [px] of the page, exact to 1e-3 scan px; nothing if no spot of the page is imaged there
  std::optional<Eigen::Vector2d> operator()(const Eigen::Vector2d& scan) const;

 private:
  struct Node {
    Eigen::Vector2f scan, page;
  };
  std::optional<Eigen::Vector2d> refine(const Eigen::Vector2d& scan, Eigen::Vector2d page) const;
  const std::vector<Node>* bucket(int column, int row) const;

  const ScanMap& map_;
  Eigen::Vector2d low_{0, 0};  ///< [px] corner of the buckets in the scan
  double cell_px_ = 1;         ///< side of a bucket in the scan
  int columns_ = 0, rows_ = 0;
  std::vector<std::vector<Node>> buckets_;
};

}  // namespace pagesweep
