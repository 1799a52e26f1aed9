// SPDX-License-Identifier: Apache-2.0
#include "cli/describe.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Geometry>
#include <algorithm>

namespace pagesweep::cli {
namespace {

constexpr double mm_per_inch = 25.4;

/// "1 page", "2 pages"
std::string count_of(const std::string& noun, std::size_t count) {
  return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

std::vector<int> dropped_frames(const Frames& frames) {
  std::vector<int> dropped;
  for (int i = 0; i < frames.count(); ++i)
    if (!frames.has(i)) dropped.push_back(i);
  return dropped;
}

template <class... Functions>
struct Overloaded : Functions... {
  using Functions::operator()...;
};
template <class... Functions>
Overloaded(Functions...) -> Overloaded<Functions...>;

std::string model_name(const Scanner& scanner) {
  return std::visit(
      Overloaded{[](const Camera&) { return "brown-conrady"; }, [](const Pushbroom&) { return "pushbroom"; },
                 [](const RotatingLine&) { return "rotating-line"; }},
      scanner.model());
}

std::string model_name(const Light& light) {
  if (std::holds_alternative<TranslatingPlane>(light.model())) return "translating-plane";
  return std::holds_alternative<RotatingPlane>(light.model()) ? "rotating-plane" : "recorded-planes";
}

Description describe_camera(const Camera& camera) {
  const Eigen::Vector3d center = camera.center().array() + 0.0;  // which makes -0 a 0
  Description description;
  description.lines.push_back(
      fmt::format("camera {}: {} x {} px, focal length {:.1f} px, at ({:.1f}, {:.1f}, {:.1f}) mm", camera.name,
                  camera.width, camera.height, camera.fx, center.x(), center.y(), center.z()));
  description.json = {{"name", camera.name},
                      {"width", camera.width},
                      {"height", camera.height},
                      {"focal_length_px", camera.fx},
                      {"center_mm", {center.x(), center.y(), center.z()}}};
  if (const auto& sensor = camera.sensor) {
    description.lines.push_back(fmt::format(
        "  sensor: {:.3g} gray values an electron, {:.2f} gray values of noise in the dark, points spread by "
        "{:.2f} px",
        sensor->gain, sensor->read_noise, sensor->psf_sigma_px));
    description.json["sensor"] = {
        {"gain", sensor->gain}, {"read_noise", sensor->read_noise}, {"psf_sigma_px", sensor->psf_sigma_px}};
  }
  return description;
}

void add_exposures(const SequenceFiles& files, Description& description) {
  const auto [shortest, longest] = std::ranges::minmax(files.exposure_ms);
  const std::string range =
      shortest == longest ? fmt::format("{}", longest) : fmt::format("{} to {}", shortest, longest);
  description.lines.push_back(fmt::format("  {}: exposed for {} ms", files.camera, range));
  description.json["exposure_ms"][files.camera] = files.exposure_ms;
}

}  // namespace

void Description::add(const std::string& key, const Description& part) {
  for (const auto& line : part.lines) lines.push_back("  " + line);
  json[key] = part.json;
}

std::string Description::text() const { return fmt::format("{}\n", fmt::join(lines, "\n")); }

Description describe_capture(const Capture& capture, std::span<const Frames> frames) {
  Description description;
  description.lines.push_back(fmt::format("a capture of {}; every frame was read", count_of("camera", frames.size())));
  description.json = {{"kind", "capture"}, {"notes", capture.notes}, {"sequences", nlohmann::ordered_json::array()}};
  for (const Frames& of_camera : frames) {
    const Sequence& sequence = of_camera.sequence();
    const auto dropped = dropped_frames(of_camera);
    description.lines.push_back(fmt::format(
        "  {}: {} frames of {} x {} px, {} bit, black level {}, saturation {}; {}", sequence.camera, sequence.count,
        sequence.width, sequence.height, sequence.bit_depth, sequence.black_level, sequence.saturation,
        dropped.empty() ? "none dropped" : fmt::format("{} dropped: {}", dropped.size(), fmt::join(dropped, ", "))));
    description.json["sequences"].push_back({{"camera", sequence.camera},
                                             {"count", sequence.count},
                                             {"width", sequence.width},
                                             {"height", sequence.height},
                                             {"bit_depth", sequence.bit_depth},
                                             {"dropped", dropped}});
  }
  for (const SequenceFiles& files : capture.sequences)
    if (!files.exposure_ms.empty()) add_exposures(files, description);
  if (!capture.notes.empty()) description.lines.push_back("  notes: " + capture.notes);
  if (!capture.scan) description.lines.emplace_back("  no scan: the surface can be measured, but no page made");
  return description;
}

Description describe_rig(const Rig& rig) {
  Description description;
  description.lines.push_back("a rig of " + count_of("camera", rig.cameras.size()));
  description.json = {{"kind", "rig"}, {"cameras", nlohmann::ordered_json::array()}};
  for (const Camera& camera : rig.cameras) {
    const Description part = describe_camera(camera);
    for (const std::string& line : part.lines) description.lines.push_back("  " + line);
    description.json["cameras"].push_back(part.json);
  }
  if (rig.cameras.size() == 2) {
    const double baseline = (rig.cameras[0].center() - rig.cameras[1].center()).norm();
    description.lines.push_back(fmt::format("  baseline: {:.2f} mm", baseline));
    description.json["baseline_mm"] = baseline;
  }
  if (rig.scanner) {
    description.lines.push_back(fmt::format("  scanner: {}, {} x {} px", model_name(*rig.scanner), rig.scanner->width(),
                                            rig.scanner->height()));
    description.json["scanner"] = {
        {"model", model_name(*rig.scanner)}, {"width", rig.scanner->width()}, {"height", rig.scanner->height()}};
  } else {
    description.lines.emplace_back("  no scanner: the surface can be measured, but no page made");
  }
  if (rig.light) {
    description.lines.push_back("  light: " + model_name(*rig.light));
    description.json["light"] = {{"model", model_name(*rig.light)}};
  }
  if (rig.lamp) {
    description.lines.push_back(
        fmt::format("  lamp: {:g} mm high, {:g} mm long", rig.lamp->height_mm, rig.lamp->length_mm));
    description.json["lamp"] = {{"height", rig.lamp->height_mm}, {"length", rig.lamp->length_mm}};
  }
  if (rig.white) {
    description.lines.push_back(fmt::format("  white: {} x {} nodes", rig.white->columns, rig.white->rows));
    description.json["white"] = {{"columns", rig.white->columns}, {"rows", rig.white->rows}};
  }
  return description;
}

Description describe_picture(const std::filesystem::path& file, const Picture& picture) {
  const double dpi = picture.pixels_per_mm * mm_per_inch;
  Description description;
  description.lines.push_back(fmt::format("{}: a picture, {} x {} px, {} {} bit, {}{}", file.filename().string(),
                                          picture.width(), picture.height(), picture.channels == 1 ? "gray" : "RGB",
                                          picture.bit_depth(),
                                          dpi > 0 ? fmt::format("{:.1f} dpi", dpi) : "of unknown scale",
                                          picture.icc_profile.empty() ? "" : ", with a colour profile"));
  description.json = {{"kind", "picture"},
                      {"width", picture.width()},
                      {"height", picture.height()},
                      {"channels", picture.channels},
                      {"bit_depth", picture.bit_depth()},
                      {"dpi", dpi > 0 ? nlohmann::ordered_json(dpi) : nlohmann::ordered_json()}};
  return description;
}

Description describe_points(const PointCloud& cloud) {
  Eigen::AlignedBox3f box;
  for (const auto& point : cloud.points) box.extend(point);
  Description description;
  description.lines.push_back("a point cloud of " + count_of("point", cloud.size()));
  description.json = {{"kind", "points"}, {"count", cloud.size()}};
  if (!box.isEmpty()) {
    const auto &low = box.min(), &high = box.max();
    description.lines.push_back(fmt::format("  x {:.1f} to {:.1f}, y {:.1f} to {:.1f}, z {:.1f} to {:.1f} mm", low.x(),
                                            high.x(), low.y(), high.y(), low.z(), high.z()));
    description.json["lowest_mm"] = {low.x(), low.y(), low.z()};
    description.json["highest_mm"] = {high.x(), high.y(), high.z()};
  }
  return description;
}

Description describe_truth(const Truth& truth) {
  Description description;
  description.lines.push_back("reference data of a synthetic capture of " + count_of("page", truth.pages.size()));
  description.json = {{"kind", "truth"}, {"pages", nlohmann::ordered_json::array()}};
  for (const TruthPage& page : truth.pages) {
    description.lines.push_back(fmt::format("  page {}: {:.1f} dpi{}", page.index, page.pixels_per_mm * mm_per_inch,
                                            page.text.empty() ? "" : ", its text in " + page.text));
    description.json["pages"].push_back({{"index", page.index}, {"pixels_per_mm", page.pixels_per_mm}});
  }
  return description;
}

Description describe_report(const JsonReader& report) {
  Description description;
  description.lines.push_back("a result: " + report.at("verdict").at("headline").text());
  description.lines.push_back("  " + report.at("verdict").at("advice").text());
  description.json = {{"kind", "result"},
                      {"headline", report.at("verdict").at("headline").text()},
                      {"advice", report.at("verdict").at("advice").text()}};
  return description;
}

}  // namespace pagesweep::cli
