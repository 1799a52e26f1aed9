// SPDX-License-Identifier: Apache-2.0
// pagesweep_bench: how long whole ways take, beside what they are compared with.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <exception>

#include "bench/comparison.h"

namespace {

using pagesweep::bench::Report;
using pagesweep::bench::Settings;

struct Group {
  const char* name;
  void (*measure)(const Settings&, Report&);
};
constexpr Group groups[] = {
    {"time-values", pagesweep::bench::measure_time_values}, {"streaming", pagesweep::bench::measure_streaming},
    {"points", pagesweep::bench::measure_points},           {"growth", pagesweep::bench::measure_growth},
    {"scalar", pagesweep::bench::measure_plain_code},       {"gray-code", pagesweep::bench::measure_gray_code},
    {"reading", pagesweep::bench::measure_reading}};

}  // namespace

int main(int argc, char** argv) try {
  CLI::App app("Measures how long whole ways take, interleaved with what they are compared with.", "pagesweep_bench");
  Settings settings;
  std::vector<std::string> only;
  std::filesystem::path json;
  app.add_option("--only", only,
                 "groups to run: time-values, streaming, points, growth, scalar, gray-code, reading [all]");
  app.add_option("--rounds", settings.rounds, "how often each way runs [5]")->check(CLI::PositiveNumber);
  app.add_option("--gray-code", settings.gray_code_capture,
                 "capture of a projected Gray code: of the columns, each pattern followed by its inverse, then white "
                 "and black")
      ->envname("PAGESWEEP_GRAY_CODE");
  app.add_option("--read", settings.captures_to_read, "captures that differ only in how their frames are stored");
  app.add_option("--json", json, "writes the figures there as well");
  CLI11_PARSE(app, argc, argv);

  Report report;
  for (const Group& group : groups) {
    if (!only.empty() && std::ranges::find(only, group.name) == only.end()) continue;
    const auto start = std::chrono::steady_clock::now();
    group.measure(settings, report);
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    report.note(fmt::format("measuring {} took {:.0f} s", group.name, taken.count()));
  }
  if (!json.empty()) report.write_json(json);
  return 0;
} catch (const std::exception& error) {
  fmt::print(stderr, "pagesweep_bench: {}\n", error.what());
  return 1;
}
