// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace pagesweep::bench {

/// A number that was measured several times.
struct Figure {
  std::string what;
  std::string unit;
  std::vector<double> values;
  std::optional<double> goal = {};  ///< of the median
  bool at_least = false;            ///< the goal is a lower bound

  double median() const;
};

/// One of the ways to do something. What it needs anew each time, and nobody should pay for, is made before.
struct Way {
  std::function<void()> run;
  std::function<void()> prepare = [] {};
};

/// Seconds of each way, one a round. In a round every way runs once, one after the other: what disturbs the machine for
/// a while disturbs all of them alike, and not their ratios. A round that does not count goes before.
std::vector<std::vector<double>> interleave(int rounds, std::span<const Way> ways);

/// Round by round.
std::vector<double> ratios(std::span<const double> numerators, std::span<const double> denominators);

/// The exponent with which the time grows with the size, round by round: the slope of a straight line through the
/// logarithms.
/// \param seconds  of each size, as interleave() returns them
std::vector<double> exponents(std::span<const double> sizes, std::span<const std::vector<double>> seconds);

/// Collects figures, and prints each when it is known.
class Report {
 public:
  void title(const std::string& text);
  void add(Figure figure);
  void note(const std::string& text);
  void write_json(const std::filesystem::path& file) const;

 private:
  std::vector<Figure> figures_;
};

/// What the benchmarks are asked for.
struct Settings {
  int rounds = 5;
  std::filesystem::path gray_code_capture;  ///< empty: left out
  std::vector<std::filesystem::path> captures_to_read;
};

void measure_time_values(const Settings& settings, Report& report);
void measure_points(const Settings& settings, Report& report);
void measure_streaming(const Settings& settings, Report& report);
void measure_growth(const Settings& settings, Report& report);
void measure_plain_code(const Settings& settings, Report& report);
void measure_gray_code(const Settings& settings, Report& report);
void measure_reading(const Settings& settings, Report& report);

}  // namespace pagesweep::bench
