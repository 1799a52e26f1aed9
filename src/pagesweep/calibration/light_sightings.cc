// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/calibration/light_sightings.h"

#include <stdexcept>

namespace pagesweep {

std::vector<LightSighting> light_sightings(const TimeMap& times, const Camera& camera, const BoardPlace& board) {
  if (times.width() != camera.width || times.height() != camera.height)
    throw std::invalid_argument("light_sightings: the map's size is not the camera's");
  constexpr int step = 4;  // [px]
  const Eigen::Vector3d normal = board.rig_from_board.rotation.col(2);
  const Plane plane{normal, normal.dot(board.rig_from_board.translation)};
  const Rigid3 board_from_rig = board.rig_from_board.inverse();
  std::vector<LightSighting> sightings;
  for (int y = 0; y < times.height(); y += step)
    for (int x = 0; x < times.width(); x += step) {
      if (times.status(x, y) != PixelStatus::ok) continue;
      const auto ray = camera.ray({x, y});
      const auto point = ray ? plane.meet(*ray) : std::nullopt;
      if (!point) continue;
      const Eigen::Vector2d on_board = (board_from_rig * *point).head<2>();
      const bool is_inside =
          (on_board.array() >= board.lower_mm.array()).all() && (on_board.array() <= board.upper_mm.array()).all();
      if (is_inside) sightings.push_back({*point, times.time(x, y)});
    }
  return sightings;
}

}  // namespace pagesweep
