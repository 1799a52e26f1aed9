// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "pagesweep/camera/camera.h"

namespace pagesweep {

inline constexpr int most_curves = 16;  ///< followed at once; the longest vector

inline constexpr int time_block_px = 10;  ///< side of the squares of pixels whose times are bounded together

/// A time map to be asked between its pixels, as arrays. Rows follow each other without gaps.
struct TimeArrays {
  const float* time;       ///< [frames]
  const float* sigma;      ///< [frames]
  const float* amplitude;  ///< [gray values]
  const float* between;    ///< 0 where times may be interpolated between (x, y) and (x + 1, y + 1), NaN where not
  int width, height;       ///< [px] at least 2
  const float* earliest;   ///< [frames] of the pixels of a block, of those around it and of the row and column behind
                           ///< these: all that times up to a block away are interpolated from; infinity: none
  const float* latest;     ///< [frames] likewise; -infinity: none
  int blocks;              ///< in a row of the picture
};

/// The camera that is looked into.
struct LensNumbers {
  float fx, fy, cx, cy;
  float k1, k2, k3, p1, p2;
  float max_radius_squared;  ///< of ideal coordinates
};

/// Pixels that look for their times in the other camera, one entry a pixel. The picture of the point at inverse depth w
/// is that of direction + w origin, where direction = rotation (ray_x, ray_y, 1).
struct CurveBatch {
  template <class T>
  using Each = std::array<T, most_curves>;

  TimeArrays times;
  LensNumbers lens;
  std::array<float, 9> rotation;  ///< from the pixels' camera's frame to the other one's, row by row
  std::array<float, 3> origin;    ///< the pixels' camera's centre in the other camera's frame [mm]
  float far, near;                ///< [1/mm]
  float brightness;               ///< of the other camera's pixels over those of this one
  float most_contrast;            ///< of the amplitudes of a pixel and its match

  alignas(64) Each<float> ray_x, ray_y;            ///< the pixels' viewing rays in their own frame
  alignas(64) Each<float> time, sigma, amplitude;  ///< what is looked for
  alignas(64) Each<float> expected;                ///< [1/mm] near the match; NaN: not to be followed
  alignas(64) Each<float> expected_slope;          ///< [frames/px] likely there, as `slope`; NaN: not known

  alignas(64) Each<float> u, v;           ///< [px] of the match
  alignas(64) Each<float> inverse_depth;  ///< [1/mm] NaN: not found
  alignas(64) Each<float> slope;          ///< [frames/px] along the curve, over two pixels
  alignas(64) Each<float> sigma_px;       ///< along the curve, from both times' sigma
};

/// Follows a surface from the expected depths to where the times are equal, by secants. What is not found within a few
/// pixels and steps, or lies beside a gap or the border, or is not as bright as the pixel, is left to a closer look.
void follow_curves(CurveBatch& batch);

/// Places on one curve: the pictures of the points direction + (first + k step) origin, k = 0 ... count.
struct CurvePlaces {
  std::array<float, 3> direction, origin;  ///< in the other camera's frame, see CurveBatch
  float first, step;                       ///< [1/mm] about a pixel or less
  std::size_t count;
};

/// Between which places of a curve the other camera's time may become equal to `time`: k where its sign of being ahead
/// changes between k and k + 1, or it is equal at either.
/// \return whether the other camera sees any of these places
bool search_curve(const TimeArrays& times, const LensNumbers& lens, const CurvePlaces& line, float time,
                  std::vector<std::size_t>& changes);

}  // namespace pagesweep
