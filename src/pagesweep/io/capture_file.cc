// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/capture_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "pagesweep/io/json_file.h"
#include "pagesweep/io/json_reader.h"
#include "pagesweep/io/rig_file.h"

namespace pagesweep {
namespace {

constexpr int most_frames = 100'000;     ///< a sweep has hundreds
constexpr int highest_number = 1 << 30;  ///< first + count stays an int
constexpr int most_digits = 12;
constexpr double most_exposure_ratio = 1e4;  ///< beyond it is a mistake of units, or a frame without use

/// A frame path cut at its one %d or %06d.
struct FramePattern {
  std::string before, after;
  int digits = 0;

  std::string path(int number) const { return fmt::format("{}{:0{}}{}", before, number, digits, after); }
};

/// Taken apart by hand: a pattern from a file must never reach printf.
std::optional<FramePattern> parse_pattern(const std::string& text) {
  const auto percent = text.find('%');
  if (percent == std::string::npos || text.find('\0') != std::string::npos) return std::nullopt;
  const auto conversion = text.find_first_not_of("0123456789", percent + 1);
  if (conversion == std::string::npos || text[conversion] != 'd') return std::nullopt;
  const std::string width = text.substr(percent + 1, conversion - percent - 1);
  FramePattern pattern{text.substr(0, percent), text.substr(conversion + 1)};
  if (pattern.after.find('%') != std::string::npos) return std::nullopt;
  if (width.empty()) return pattern;
  if (width.front() != '0' || width.size() > 3) return std::nullopt;
  pattern.digits = std::stoi(width);
  if (pattern.digits > most_digits) return std::nullopt;
  return pattern;
}

std::filesystem::path read_path(const JsonReader& json) {
  const std::string path = json.text();
  if (path.empty() || path.find('\0') != std::string::npos) throw json.error("expected a file's path");
  return path;
}

double read_exposure(const JsonReader& json) {
  const double exposure_ms = json.number();
  if (!(exposure_ms > 0)) throw json.error(fmt::format("expected a time above 0, found {}", exposure_ms));
  return exposure_ms;
}

/// One number for all frames, or a list for each of them or to be repeated. A list that is nearly as long as the
/// sequence is a mistake.
std::vector<double> read_exposures(const JsonReader& json, int count) {
  if (!json.is_array()) return {read_exposure(json)};
  std::vector<double> exposures;
  for (const JsonReader& item : json.items()) exposures.push_back(read_exposure(item));
  const auto frames = static_cast<std::size_t>(count);
  if (exposures.empty() || (exposures.size() != frames && exposures.size() > frames / 2))
    throw json.error(fmt::format("expected one time a frame ({}), or 1 to {} that repeat, found {}", count, count / 2,
                                 exposures.size()));
  const auto [shortest, longest] = std::ranges::minmax(exposures);
  if (longest > most_exposure_ratio * shortest)
    throw json.error(fmt::format("expected times of which none is more than {} times another, found {} and {}",
                                 most_exposure_ratio, shortest, longest));
  return exposures;
}

/// Frames without a page: each once and in ascending order, which a list made by hand may have wrong.
std::vector<int> read_dropped(const JsonReader& json, int count) {
  std::vector<int> dropped;
  for (const JsonReader& item : json.items()) {
    const int frame = item.integer(0, count - 1);
    if (!dropped.empty() && frame <= dropped.back())
      throw item.error(fmt::format("expected a frame after {}, found {}", dropped.back(), frame));
    dropped.push_back(frame);
  }
  if (dropped.size() == static_cast<std::size_t>(count)) throw json.error("expected fewer frames than all");
  return dropped;
}

/// Where the frames are, once their count is known.
void read_places(const JsonReader& json, SequenceFiles& files) {
  const auto dropped = json.find("dropped");
  if (const auto recording = json.find("recording")) {
    if (const auto frames = json.find("frames"))
      throw frames->error("expected either \"frames\" or \"recording\", found both");
    files.recording = read_path(*recording);
    if (dropped) files.dropped = read_dropped(*dropped, files.count);
    return;
  }
  if (dropped)
    throw dropped->error("expected it beside \"recording\" only: the file of a dropped frame is just missing");
  files.frames = json.at("frames").text();
  if (!parse_pattern(files.frames))
    throw json.at("frames").error(
        fmt::format("expected a path with one %d or %06d where the frame's number stands and no other %, found \"{}\"",
                    files.frames));
  const auto first = json.find("first");
  files.first = first ? first->integer(0, highest_number) : 0;
}

/// One a frame, null where it was dropped, ascending.
std::vector<std::int64_t> read_timestamps(const JsonReader& json, int count) {
  std::vector<std::int64_t> timestamps;
  std::int64_t last = no_timestamp;
  for (const JsonReader& item : json.items()) {
    timestamps.push_back(item.is_null() ? no_timestamp : item.big_integer());
    if (timestamps.back() == no_timestamp) continue;
    if (timestamps.back() <= last)
      throw item.error(fmt::format("expected a time after {}, found {}", last, timestamps.back()));
    last = timestamps.back();
  }
  if (timestamps.size() != static_cast<std::size_t>(count))
    throw json.error(
        fmt::format("expected one time a frame ({}), null for a dropped one, found {}", count, timestamps.size()));
  if (last == no_timestamp) throw json.error("expected a time of at least one frame");
  return timestamps;
}

SequenceFiles read_sequence(const JsonReader& json) {
  SequenceFiles files;
  files.camera = json.at("camera").text();
  files.count = json.at("count").integer(1, most_frames);
  read_places(json, files);
  files.bit_depth = json.at("bit_depth").integer(1, 16);
  const double levels = std::exp2(files.bit_depth);
  files.black_level = json.at("black_level").number(0, levels);
  files.saturation = json.at("saturation").number(0, levels);
  if (!(files.saturation > files.black_level))
    throw json.at("saturation")
        .error(fmt::format("expected more than black_level ({}), found {}", files.black_level, files.saturation));
  if (const auto exposure = json.find("exposure_ms")) files.exposure_ms = read_exposures(*exposure, files.count);
  if (const auto timestamps = json.find("timestamps_ns"))
    files.timestamps_ns = read_timestamps(*timestamps, files.count);
  return files;
}

std::vector<SequenceFiles> read_sequences(const JsonReader& json) {
  std::vector<SequenceFiles> sequences;
  for (const JsonReader& item : json.items()) {
    SequenceFiles files = read_sequence(item);
    for (const SequenceFiles& other : sequences)
      if (other.camera == files.camera)
        throw item.at("camera").error(
            fmt::format("expected another camera: there is a sequence of \"{}\" already", files.camera));
    if (!sequences.empty() && files.count != sequences[0].count)
      throw item.at("count").error(
          fmt::format("expected {} as for \"{}\", found {}: frame i of every camera is exposed at the same instant, "
                      "and a file that "
                      "is missing at the end is a dropped frame",
                      sequences[0].count, sequences[0].camera, files.count));
    sequences.push_back(std::move(files));
  }
  if (sequences.empty()) throw json.error("expected at least one sequence");
  return sequences;
}

}  // namespace

std::optional<std::filesystem::path> Capture::scan_path() const {
  return scan ? std::optional(folder / *scan) : std::nullopt;
}

std::filesystem::path Capture::frame_path(const SequenceFiles& sequence, int i) const {
  const auto pattern = parse_pattern(sequence.frames);
  if (!pattern) throw std::invalid_argument("a sequence's frames need one %d or %06d: " + sequence.frames);
  return folder / pattern->path(sequence.first + i);
}

Capture read_capture(const std::filesystem::path& folder_or_file) {
  const bool is_folder = std::filesystem::is_directory(folder_or_file);
  const auto file = is_folder ? folder_or_file / "capture.json" : folder_or_file;
  const JsonReader json = JsonReader::read(file);
  json.expect_format("pagesweep-capture", 1);
  Capture capture;
  capture.folder = file.parent_path();
  capture.rig = read_path(json.at("rig"));
  capture.sequences = read_sequences(json.at("sequences"));
  if (const auto scan = json.find("scan")) capture.scan = read_path(scan->at("image"));
  if (const auto notes = json.find("notes")) capture.notes = notes->text();
  if (const auto interval = json.find("frame_interval_ns")) capture.frame_interval_ns = interval->number(1, 1e12);
  if (const auto triggered = json.find("triggered")) capture.is_triggered = triggered->boolean();
  return capture;
}

namespace {

nlohmann::ordered_json to_json(const SequenceFiles& files) {
  nlohmann::ordered_json json = {{"camera", files.camera}};
  if (files.recording.empty()) {
    if (!parse_pattern(files.frames)) throw std::invalid_argument("write_capture: no frame pattern: " + files.frames);
    json["frames"] = files.frames;
    json["first"] = files.first;
  } else {
    json["recording"] = files.recording.generic_string();
    if (!files.dropped.empty()) json["dropped"] = files.dropped;
  }
  json["count"] = files.count;
  json["bit_depth"] = files.bit_depth;
  json["black_level"] = files.black_level;
  json["saturation"] = files.saturation;
  if (files.exposure_ms.size() == 1) json["exposure_ms"] = files.exposure_ms.front();
  if (files.exposure_ms.size() > 1) json["exposure_ms"] = files.exposure_ms;
  for (const std::int64_t time : files.timestamps_ns)
    json["timestamps_ns"].push_back(time == no_timestamp ? nlohmann::ordered_json() : nlohmann::ordered_json(time));
  return json;
}

}  // namespace

void write_capture(const Capture& capture) {
  nlohmann::ordered_json json = {
      {"format", "pagesweep-capture"}, {"version", 1}, {"rig", capture.rig.generic_string()}};
  json["sequences"] = nlohmann::ordered_json::array();
  for (const SequenceFiles& files : capture.sequences) json["sequences"].push_back(to_json(files));
  if (capture.scan) json["scan"] = {{"image", capture.scan->generic_string()}};
  if (capture.frame_interval_ns > 0) json["frame_interval_ns"] = capture.frame_interval_ns;
  if (!capture.is_triggered) json["triggered"] = false;
  if (!capture.notes.empty()) json["notes"] = capture.notes;
  write_json(capture.folder / "capture.json", json);
}

Rig read_capture_rig(const Capture& capture) { return read_rig(capture.rig_path()); }

}  // namespace pagesweep
