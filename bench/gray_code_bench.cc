// SPDX-License-Identifier: Apache-2.0
// The sequence matcher against OpenCV on a real capture of a projected Gray code.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "bench/comparison.h"
#include "bench/peers.h"
#include "pagesweep/base/local_plane.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/camera/ray_table.h"
#include "pagesweep/io/capture_file.h"
#include "pagesweep/matching/match_sequences.h"
#include "pagesweep/triangulation/triangulate.h"

namespace pagesweep::bench {
namespace {

/// \return depths of the points of the first camera [mm], whose frame is the rig's; NaN where there is no point
Image<float> match_by_sequence(const StereoFrames& frames) {
  const RayTable first(frames.first_camera), second(frames.second_camera);
  const MatchPair matches = match_sequences(frames.first, frames.second, first, second);
  return triangulate(matches.from_first, {}, first, second).z;
}

double count_points(const Image<float>& depths) {
  return static_cast<double>(std::ranges::count_if(depths.pixels(), [](float z) { return std::isfinite(z); }));
}

/// How far points are from the robust plane through the 9 x 9 pixels around them, median [mm]: their scatter, and what
/// the surface bends within nine pixels. Without a truth this is what can be told of the points' error.
double scatter(const Image<float>& depths) {
  constexpr int stride = 5, radius = 4;
  std::vector<float> distances;
  for (int y = 0; y < depths.height(); y += stride)
    for (int x = 0; x < depths.width(); x += stride) {
      if (!std::isfinite(depths(x, y))) continue;
      if (const auto plane = fit_plane(depths, x, y, radius)) distances.push_back(std::abs(plane->middle));
    }
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  if (middle == distances.end()) return not_a_number;
  std::ranges::nth_element(distances, middle);
  return *middle;
}

/// Points a second.
std::vector<double> rates(const Image<float>& depths, const std::vector<double>& seconds) {
  std::vector<double> values;
  for (const double s : seconds) values.push_back(count_points(depths) / s * 1e-6);
  return values;
}

void compare(const StereoFrames& frames, int threads, const Settings& settings, Report& report) {
  constexpr double near_mm = 600, far_mm = 1500;  // what StereoSGBM has to be told, the other two find out
  const ThreadLimit limit(threads);
  limit_peer_threads(threads);
  Image<float> ours, decoded, block_matched;
  const int white = frames.first.count() - 2;
  const std::vector<Way> ways = {{[&] { ours = match_by_sequence(frames); }},
                                 {[&] { decoded = decode_gray_code(frames); }},
                                 {[&] { block_matched = match_blocks(frames, white, near_mm, far_mm); }}};
  const auto seconds = interleave(settings.rounds, std::span(ways).first(has_peers() ? 3 : 1));
  const std::string with = fmt::format(", {} thread{}", threads, threads == 1 ? "" : "s");
  report.add({"sequence matcher" + with, "s", seconds[0]});
  report.add({"sequence matcher: points a second" + with, "million", rates(ours, seconds[0])});
  if (!has_peers()) return;
  report.add({"OpenCV GrayCodePattern" + with, "s", seconds[1]});
  report.add({"OpenCV GrayCodePattern: points a second" + with, "million", rates(decoded, seconds[1])});
  report.add({"OpenCV StereoSGBM on the white frames" + with, "s", seconds[2]});
  report.add({"OpenCV StereoSGBM: points a second" + with, "million", rates(block_matched, seconds[2])});
  report.add({"sequence matcher over GrayCodePattern, time" + with, "", ratios(seconds[0], seconds[1]), 1});
  if (threads != 1) return;
  const auto add_result = [&](const std::string& who, const Image<float>& depths) {
    report.add({who + ": pixels of camera 1 with a point", "", {count_points(depths)}});
    report.add({who + ": scatter of the points' depths, median", "mm", {scatter(depths)}});
  };
  add_result("sequence matcher", ours);
  add_result("OpenCV GrayCodePattern", decoded);
  add_result("OpenCV StereoSGBM", block_matched);
  const double points_ratio = count_points(ours) / count_points(decoded);
  report.add({"sequence matcher over GrayCodePattern, points", "", {points_ratio}, 1, true});
}

}  // namespace

void measure_gray_code(const Settings& settings, Report& report) {
  report.title("Sequence matcher against OpenCV on a real capture of a Gray code");
  if (settings.gray_code_capture.empty() || !std::filesystem::exists(settings.gray_code_capture)) {
    report.note("left out: no capture is given (--gray-code or PAGESWEEP_GRAY_CODE)");
    return;
  }
  if (!has_peers()) report.note("OpenCV with structured_light was not there when this was built");
  const Capture capture = read_capture(settings.gray_code_capture);
  const Rig rig = read_capture_rig(capture);
  const std::vector<Frames> frames = read_all(*open_capture(capture, rig));
  const StereoFrames pair{frames.at(0), frames.at(1), *rig.find_camera(frames[0].sequence().camera),
                          *rig.find_camera(frames[1].sequence().camera)};
  for (const int threads : {1, 2}) compare(pair, threads, settings, report);
}

}  // namespace pagesweep::bench
