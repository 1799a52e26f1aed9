// SPDX-License-Identifier: Apache-2.0
// The sequence matcher against OpenCV on a real capture of a projected Gray code.
#include <fmt/format.h>

#include <algorithm>

#include "bench/comparison.h"
#include "bench/peers.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/camera/ray_table.h"
#include "pagesweep/io/capture_file.h"
#include "pagesweep/matching/match_sequences.h"
#include "pagesweep/triangulation/triangulate.h"

namespace pagesweep::bench {
namespace {

std::int64_t match_by_sequence(const StereoFrames& frames) {
  const RayTable first(frames.first_camera), second(frames.second_camera);
  const MatchPair matches = match_sequences(frames.first, frames.second, first, second);
  const PointMap points = triangulate(matches.from_first, {}, first, second);
  return std::ranges::count(points.status.pixels(), PixelStatus::ok);
}

/// Points a second.
std::vector<double> rates(std::int64_t points, const std::vector<double>& seconds) {
  std::vector<double> values;
  for (const double s : seconds) values.push_back(static_cast<double>(points) / s * 1e-6);
  return values;
}

void compare(const StereoFrames& frames, int threads, const Settings& settings, Report& report) {
  constexpr double near_mm = 600, far_mm = 1500;  // what StereoSGBM has to be told, the other two find out
  const ThreadLimit limit(threads);
  limit_peer_threads(threads);
  std::int64_t ours = 0, decoded = 0, block_matched = 0;
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
  report.add({"sequence matcher: pixels of camera 1 with a point", "", {static_cast<double>(ours)}});
  report.add({"OpenCV GrayCodePattern: pixels of camera 1 with a point", "", {static_cast<double>(decoded)}});
  report.add({"OpenCV StereoSGBM: pixels of camera 1 with a point", "", {static_cast<double>(block_matched)}});
  report.add({"sequence matcher over GrayCodePattern, points",
              "",
              {static_cast<double>(ours) / static_cast<double>(decoded)},
              1,
              true});
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
