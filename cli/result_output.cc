// SPDX-License-Identifier: Apache-2.0
#include "cli/result_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>

#include "cli/exit_code.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/timing/advise_exposure.h"

namespace pagesweep::cli {
namespace {

constexpr std::size_t most_report_bytes = 64 << 20;
constexpr int profile_samples = 81;

std::vector<ProfileSample> sample(const StripeProfile& profile) {
  std::vector<ProfileSample> samples;
  for (int i = 0; i < profile_samples; ++i) {
    const double time = profile.begin() + (profile.end() - profile.begin()) * i / (profile_samples - 1);
    samples.push_back({time, profile.value(time)});
  }
  return samples;
}

std::vector<Figure> figures_of(const SensorNoise& noise, const std::string& camera) {
  return {
      {camera, "read_noise", "noise of the sensor without light", std::sqrt(noise.read_variance), "gray values", ""},
      {camera, "gain", "gray values a photoelectron", noise.gain, "gray values", ""}};
}

void add_figures(std::vector<Figure>& figures, const EdgeCorrection& edges, const std::string& camera) {
  figures.push_back({camera, "edges_before", "time values at edges of print against those around, over their sigma",
                     edges.before, "", ""});
  figures.push_back(
      {camera, "edges_after", "the same after they were moved to the pixels' centres", edges.after, "", ""});
}

void add_figures(std::vector<Figure>& figures, const FusionCounts& counts, const std::string& camera) {
  const auto add = [&](const char* name, const char* what, std::int64_t count) {
    figures.push_back({camera, name, what, static_cast<double>(count), "points", ""});
  };
  add("points_fused", "points of both cameras and the sheet of light", counts.weighted);
  add("points_by_light", "points that this camera alone measured, with the sheet of light", counts.added);
  add("points_corrected", "matches that the sheet of light contradicted and replaced", counts.corrected);
}

std::vector<Figure> figures_of(const LightSweep& sweep) {
  return {{"light", "speed", "speed of the stripe over the table", sweep.mm_per_frame, "mm/frame", ""},
          {"light", "unevenness_rms", "the stripe ahead of or behind an even motion, rms", sweep.unevenness_rms_mm,
           "mm", ""},
          {"light", "unevenness_max", "the same, at most", sweep.unevenness_max_mm, "mm", ""},
          {"light", "misfit", "points off the sheet of light of their time, robust standard deviation", sweep.misfit_mm,
           "mm", ""}};
}

void add_figures(std::vector<Figure>& figures, const ExposureAdvice& advice, const std::string& camera) {
  figures.push_back({camera, "clipped_share", "pixels that the stripe passed and that were clipped",
                     100 * advice.clipped_share, "%", ""});
  figures.push_back(
      {camera, "dark_share", "pixels that the stripe passed and that were too dark", 100 * advice.dark_share, "%", ""});
  figures.push_back({camera, "light_factor",
                     "the light, by exposure or gain, that would use the range well, over that which there was",
                     advice.light_factor, "", ""});
  figures.push_back({camera, "speed_factor",
                     "the light's speed, in mm a frame, that would suit time values, over that which there was",
                     advice.speed_factor, "", ""});
}

std::vector<CameraReport> cameras_of(const RunResult& result) {
  const Measurement& measurement = result.measurement;
  std::vector<CameraReport> cameras;
  for (std::size_t c = 0; c < measurement.cameras.size(); ++c) {
    CameraReport camera;
    camera.name = measurement.cameras[c].name;
    camera.points = &measurement.points[c];
    camera.dropped = measurement.dropped_frames[c];
    if (c < result.sequences.size()) camera.frames = result.sequences[c].count;
    if (measurement.timing) {
      camera.times = &measurement.timing->maps[c];
      camera.figures = figures_of(measurement.timing->noise[c], camera.name);
      if (c < result.sequences.size()) {
        const ExposureAdvice advice = advise_exposure(result.sequences[c], measurement.timing->maps[c],
                                                      measurement.clipped_frames[c], measurement.timing->profile);
        add_figures(camera.figures, advice, camera.name);
        camera.exposure = describe(advice);
      }
    }
    if (c < measurement.edges.size()) add_figures(camera.figures, measurement.edges[c], camera.name);
    if (c < measurement.fusion.size()) add_figures(camera.figures, measurement.fusion[c], camera.name);
    std::ranges::copy_if(result.figures, std::back_inserter(camera.figures),
                         [&](const Figure& figure) { return figure.group == camera.name; });
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

ReportInputs inputs_of(const RunResult& result, std::span<const PageQuality> quality, const ConsoleProgress& progress) {
  ReportInputs inputs;
  inputs.title = result.title;
  inputs.program = "pagesweep " PAGESWEEP_VERSION;
  inputs.cameras = cameras_of(result);
  if (const auto& timing = result.measurement.timing) {
    inputs.profile = sample(timing->profile);
    inputs.figures.push_back({"stripe", "fwhm", "duration of the stripe at one spot, at half its height",
                              timing->profile.full_width_half_maximum(), "frames", ""});
  }
  if (const auto& sweep = result.measurement.sweep)
    for (Figure& figure : figures_of(*sweep)) inputs.figures.push_back(std::move(figure));
  std::ranges::copy_if(result.figures, std::back_inserter(inputs.figures), [&](const Figure& figure) {
    return std::ranges::find(inputs.cameras, figure.group, &CameraReport::name) == inputs.cameras.end();
  });
  inputs.surfaces = result.surfaces;
  inputs.pages = result.pages;
  inputs.quality = quality;
  inputs.scan = result.scan;
  inputs.pages_expected = result.scan != nullptr;
  inputs.options = result.options;
  inputs.times = progress.times();
  inputs.warnings = progress.warnings();
  return inputs;
}

std::string summary(const OutputFolder& output, const Verdict& verdict) {
  std::string text = verdict.headline + "\n" + verdict.advice + "\n";
  for (const auto& remark : verdict.remarks) text += "  " + remark + "\n";
  return text + "Report: " + (output.path() / "report.html").string() + "\n";
}

}  // namespace

void add_measuring_options(std::vector<OptionValue>& values, const ScanOptions& options) {
  values.push_back({"matching", "matcher", std::string(name_of(options.matcher)), ""});
  add_options(values, "timing", options.timing);
  values.push_back({"timing", "edges", std::string(name_of(options.edges)), ""});
  add_options(values, "matching", options.matching);
  values.push_back({"triangulation", "fusion", options.fusion, ""});
  add_options(values, "triangulation", options.triangulation);
}

void add_flattening_options(std::vector<OptionValue>& values, const ScanOptions& options) {
  add_options(values, "surfacing", options.surface);
  add_options(values, "dewarping", options.dewarp);
}

void write_scan(OutputFolder& output, const ScanResult& scan, ConsoleProgress& progress, const CommonOptions& options) {
  progress.begin("writing the pages");
  output.begin();
  write_measurement(output.path(), scan.scan.measurement);
  if (scan.picture)
    write_pages(output.path(), scan.scan.pages, scan.scan.surfaces, scan.files,
                {scan.title, "pagesweep " PAGESWEEP_VERSION});
  RunResult result{.title = scan.title,
                   .sequences = scan.sequences,
                   .measurement = scan.scan.measurement,
                   .surfaces = scan.scan.surfaces,
                   .pages = scan.scan.pages,
                   .scan = scan.picture,
                   .kernel = scan.options.dewarp.resampling.kernel,
                   .fail_on = scan.fail_on,
                   .figures = scan.figures};
  add_measuring_options(result.options, scan.options);
  add_flattening_options(result.options, scan.options);
  finish_result(output, result, progress, options);
}

void finish_result(OutputFolder& output, const RunResult& result, ConsoleProgress& progress,
                   const CommonOptions& options) {
  std::vector<PageQuality> quality;
  if (result.scan) {
    progress.begin("measuring the pages' quality");
    quality = measure_quality(result.pages, result.surfaces, *result.scan, result.kernel);
  }
  progress.finish();
  const ReportInputs inputs = inputs_of(result, quality, progress);
  write_report(output.path(), inputs);
  output.finish();
  const std::string report = read_bytes(output.path() / "report.json", most_report_bytes);
  print_answer(options, nlohmann::ordered_json::parse(report), summary(output, judge(inputs)));
  const auto worst = std::ranges::max_element(quality, {}, &PageQuality::verdict);
  if (worst == quality.end() || result.fail_on == FailOn::never) return;
  if (worst->verdict == PageVerdict::scan_again ||
      (worst->verdict == PageVerdict::look && result.fail_on == FailOn::look))
    throw LimitExceeded{};
}

}  // namespace pagesweep::cli
