// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/image.h"
#include "pagesweep/camera/camera.h"
#include "pagesweep/data/frames.h"

namespace pagesweep::bench {

/// Two cameras' frames of 8 bit for another program. The references outlive it.
struct StereoFrames {
  const Frames& first;
  const Frames& second;
  const Camera& first_camera;
  const Camera& second_camera;
};

/// Whether there is any other program to compare with.
bool has_peers();

/// Limits the threads of what follows; 0: all cores.
void limit_peer_threads(int threads);

/// OpenCV's GrayCodePattern: the pictures are rectified, decoded, and their pixels of equal code become points.
/// \return for the pixels of the first camera, rectified, their points' depths [mm]; NaN where there is no point
Image<float> decode_gray_code(const StereoFrames& frames);

/// OpenCV's StereoSGBM of one pair of frames: rectified, matched over the depths given, made points.
/// \return as decode_gray_code()
Image<float> match_blocks(const StereoFrames& frames, int frame, double near_mm, double far_mm);

}  // namespace pagesweep::bench
