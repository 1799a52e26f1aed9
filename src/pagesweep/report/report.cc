// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/report/report.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "pagesweep/base/error.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/json_file.h"
#include "pagesweep/report/html.h"

namespace pagesweep {
namespace {

using Json = nlohmann::ordered_json;

/// JSON knows no NaN, and text that is no UTF-8 would not be written at all.
Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }
std::string utf8(const std::string& text) {
  return Json::parse(Json(text).dump(-1, ' ', false, Json::error_handler_t::replace)).get<std::string>();
}

Json to_json(std::span<const Figure> figures) {
  Json groups = Json::object();
  for (const Figure& figure : figures) {
    Json& entry = groups[utf8(figure.group)][utf8(figure.name)];
    entry = {{"value", number(figure.value)}, {"unit", utf8(figure.unit)}};
    if (!figure.reason.empty()) entry["reason"] = utf8(figure.reason);
  }
  return groups;
}

Json to_json(const StatusCounts& counts) {
  Json json = Json::object();
  for (std::size_t s = 0; s < counts.size(); ++s) json[std::string(names_of(PixelStatus{})[s])] = counts[s];
  return json;
}

Json to_json(const CameraReport& camera) {
  Json json{{"name", utf8(camera.name)}, {"frames", camera.frames}, {"dropped", camera.dropped}};
  if (camera.points) {
    json["typical_sigma_mm"] = number(typical_sigma({&camera, 1}));
    json["points"] = to_json(count_status(camera.points->status));
  }
  if (camera.times) json["times"] = to_json(count_status(camera.times->status));
  if (!camera.figures.empty()) json["figures"] = to_json(camera.figures);
  if (!camera.exposure.empty()) json["exposure"] = utf8(camera.exposure);
  return json;
}

Json to_json(const Page& page) {
  const double pixels_per_mm = page.picture.pixels_per_mm;
  const auto mm = [&](int pixels) { return pixels_per_mm > 0 ? Json(pixels / pixels_per_mm) : Json(nullptr); };
  return {{"index", page.index},
          {"width_mm", mm(page.picture.width())},
          {"height_mm", mm(page.picture.height())},
          {"dpi", 25.4 * pixels_per_mm},
          {"deskew_rad", number(page.deskew_rad)},
          {"measured_share", number(page.measured_share)}};
}

Json to_json(const Image<float>& values) {
  Json json = Json::array();
  for (const float value : values.pixels()) json.push_back(number(std::round(double(value) * 10) / 10));
  return json;
}

Json to_json(const Mtf& mtf) {
  Json json = Json::array();
  for (const double value : mtf.values) json.push_back(number(std::round(value * 1e4) / 1e4));
  return json;
}

Json to_json(const PageQuality& quality) {
  Json json{{"verdict", std::string(name_of(quality.verdict))}, {"reasons", quality.reasons}};
  for (const QualityFigure& figure : quality.figures) {
    Json& entry = json["figures"][figure.figure.name];
    entry = {{"value", number(figure.figure.value)}, {"unit", figure.figure.unit}};
    if (!figure.fadgi.empty()) entry["fadgi"] = figure.fadgi;
    if (!figure.iso.empty()) entry["iso_19264"] = figure.iso;
    if (!figure.figure.reason.empty()) entry["reason"] = figure.figure.reason;
  }
  const ResolutionMap& map = quality.resolution;
  json["resolution_map"] = {{"pitch_mm", map.pitch_mm},
                            {"columns", map.across_dpi.width()},
                            {"rows", map.across_dpi.height()},
                            {"across_dpi", to_json(map.across_dpi)},
                            {"down_dpi", to_json(map.down_dpi)}};
  json["mtf"] = {{"cycles_per_px", Mtf{}.step},
                 {"across", to_json(quality.sharpness[0].page)},
                 {"down", to_json(quality.sharpness[1].page)},
                 {"scan_across", to_json(quality.sharpness[0].scan)},
                 {"scan_down", to_json(quality.sharpness[1].scan)}};
  return json;
}

Json to_json(const Verdict& verdict) {
  Json remarks = Json::array();
  for (const std::string& remark : verdict.remarks) remarks.push_back(utf8(remark));
  return {{"level", std::string(name_of(verdict.level))},
          {"headline", utf8(verdict.headline)},
          {"advice", utf8(verdict.advice)},
          {"remarks", std::move(remarks)}};
}

Json to_json(const ReportInputs& inputs, const Verdict& verdict) {
  Json json{
      {"format", "pagesweep-report"}, {"version", 1}, {"program", utf8(inputs.program)}, {"title", utf8(inputs.title)}};
  json["verdict"] = to_json(verdict);
  json["cameras"] = Json::array();
  for (const CameraReport& camera : inputs.cameras) json["cameras"].push_back(to_json(camera));
  json["pages"] = Json::array();
  for (const Page& page : inputs.pages) json["pages"].push_back(to_json(page));
  for (std::size_t i = 0; i < std::min(inputs.surfaces.size(), inputs.pages.size()); ++i) {
    const PageSurface& surface = inputs.surfaces[i];
    const StrainSummary strain = summarise_strain(surface);
    Json& page = json["pages"][i];
    page["model"] = utf8(surface.model_name);
    page["strain_rms"] = number(strain.rms);
    page["unexplained_strain_share"] = number(strain.unexplained_share);
    page["covered_share"] = number(covered_share(surface));
  }
  for (std::size_t i = 0; i < std::min(inputs.quality.size(), inputs.pages.size()); ++i)
    json["pages"][i]["quality"] = to_json(inputs.quality[i]);
  if (!inputs.profile.empty()) {
    Json& profile = json["stripe_profile"] = {{"time_frames", Json::array()}, {"light", Json::array()}};
    for (const ProfileSample& sample : inputs.profile) {
      profile["time_frames"].push_back(number(sample.time_frames));
      profile["light"].push_back(number(sample.light));
    }
  }
  json["figures"] = to_json(inputs.figures);
  json["options"] = Json::object();
  for (const OptionValue& option : inputs.options)
    json["options"][utf8(option.station)][utf8(option.name)] = std::visit(
        [](const auto& value) {
          if constexpr (std::is_same_v<std::decay_t<decltype(value)>, std::string>)
            return Json(utf8(value));
          else
            return Json(value);
        },
        option.value);
  json["seconds"] = Json::object();
  for (const StationTime& time : inputs.times) json["seconds"][utf8(time.station)] = number(time.seconds);
  json["warnings"] = Json::array();
  for (const std::string& warning : inputs.warnings) json["warnings"].push_back(utf8(warning));
  return json;
}

}  // namespace

StatusCounts count_status(const Image<PixelStatus>& status) {
  StatusCounts counts{};
  for (const PixelStatus s : status.pixels()) ++counts[std::min(static_cast<std::size_t>(s), counts.size() - 1)];
  return counts;
}

double typical_sigma(std::span<const CameraReport> cameras) {
  std::vector<float> sigmas;
  for (const CameraReport& camera : cameras)
    for (std::size_t i = 0; camera.points && i < camera.points->status.size(); ++i)
      if (camera.points->status.data()[i] == PixelStatus::ok && std::isfinite(camera.points->sigma.data()[i]))
        sigmas.push_back(camera.points->sigma.data()[i]);
  if (sigmas.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = sigmas.begin() + static_cast<std::ptrdiff_t>(sigmas.size() / 2);
  std::nth_element(sigmas.begin(), middle, sigmas.end());
  return *middle;
}

void write_report(const std::filesystem::path& folder, const ReportInputs& inputs) {
  const Verdict verdict = judge(inputs);
  write_bytes(folder / "report.html", format_report(inputs, verdict, PictureEncoder(folder)));
  write_json(folder / "report.json", to_json(inputs, verdict));
}

void add_evaluation(const std::filesystem::path& folder, std::span<const Figure> figures,
                    std::span<const FigureMap> maps) {
  const std::filesystem::path file = folder / "report.html";
  constexpr std::size_t most_bytes = std::size_t{1} << 26;
  std::string html = read_bytes(file, most_bytes);
  const std::size_t begin = html.find(evaluation_begin);
  const std::size_t end = html.find(evaluation_end);
  if (begin == std::string::npos || end == std::string::npos || end < begin)
    throw bad_input(file, "",
                    "this is no report that an evaluation can be added to; write it anew with 'pagesweep scan'");
  html.replace(begin + evaluation_begin.size(), end - begin - evaluation_begin.size(),
               format_evaluation(figures, maps, PictureEncoder(folder)));
  write_bytes(file, html);
}

}  // namespace pagesweep
