// SPDX-License-Identifier: Apache-2.0
#include "bench/comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "pagesweep/io/json_file.h"

namespace pagesweep::bench {
namespace {

double seconds_of(const Way& way) {
  way.prepare();
  const auto start = std::chrono::steady_clock::now();
  way.run();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

double Figure::median() const {
  std::vector<double> sorted = values;
  std::ranges::sort(sorted);
  const std::size_t middle = sorted.size() / 2;
  return sorted.size() % 2 == 1 ? sorted[middle] : 0.5 * (sorted[middle - 1] + sorted[middle]);
}

std::vector<std::vector<double>> interleave(int rounds, std::span<const Way> ways) {
  std::vector<std::vector<double>> seconds(ways.size());
  for (int round = -1; round < rounds; ++round)
    for (std::size_t k = 0; k < ways.size(); ++k) {
      const double taken = seconds_of(ways[k]);
      if (round >= 0) seconds[k].push_back(taken);
    }
  return seconds;
}

std::vector<double> ratios(std::span<const double> numerators, std::span<const double> denominators) {
  std::vector<double> values;
  for (std::size_t k = 0; k < numerators.size(); ++k) values.push_back(numerators[k] / denominators[k]);
  return values;
}

std::vector<double> exponents(std::span<const double> sizes, std::span<const std::vector<double>> seconds) {
  std::vector<double> slopes;
  for (std::size_t round = 0; round < seconds.front().size(); ++round) {
    double n = 0, x = 0, y = 0, xx = 0, xy = 0;
    for (std::size_t k = 0; k < sizes.size(); ++k) {
      const double log_size = std::log(sizes[k]), log_time = std::log(seconds[k][round]);
      n += 1, x += log_size, y += log_time, xx += log_size * log_size, xy += log_size * log_time;
    }
    slopes.push_back((n * xy - x * y) / (n * xx - x * x));
  }
  return slopes;
}

void Report::title(const std::string& text) { fmt::print("\n{}\n", text); }

void Report::note(const std::string& text) { fmt::print("  {}\n", text); }

void Report::add(Figure figure) {
  const auto [lowest, highest] = std::ranges::minmax(figure.values);
  const double median = figure.median();
  std::string goal;
  if (figure.goal) {
    const bool met = figure.at_least ? median >= *figure.goal : median <= *figure.goal;
    goal = fmt::format("   goal {} {:g}: {}", figure.at_least ? ">=" : "<=", *figure.goal, met ? "met" : "MISSED");
  }
  fmt::print("  {:<76} {:>8.4g} {:<10} ({:.4g} to {:.4g}){}\n", figure.what, median, figure.unit, lowest, highest,
             goal);
  std::fflush(stdout);
  figures_.push_back(std::move(figure));
}

void Report::write_json(const std::filesystem::path& file) const {
  auto json = nlohmann::ordered_json::array();
  for (const Figure& figure : figures_) {
    json.push_back({{"figure", figure.what}, {"unit", figure.unit}, {"values", figure.values}});
    if (figure.goal) json.back()["goal"] = *figure.goal;
    json.back()["at_least"] = figure.at_least;
  }
  pagesweep::write_json(file, json);
}

}  // namespace pagesweep::bench
