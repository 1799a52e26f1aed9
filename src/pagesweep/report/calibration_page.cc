// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "pagesweep/io/atomic_file.h"
#include "pagesweep/report/calibration_report.h"
#include "pagesweep/report/html.h"

namespace pagesweep {
namespace {

constexpr std::size_t most_outliers_listed = 60;
constexpr double strong_correlation = 0.9;

std::string cell(const std::string& value) { return "<td class=\"n\">" + value + "</td>"; }

std::string format_verdict(const CalibrationReport& report) {
  std::string remarks;
  for (const std::string& remark : report.remarks) remarks += "<li>" + escape_html(remark) + "</li>";
  if (!remarks.empty()) remarks = "<ul>" + remarks + "</ul>";
  return fmt::format("<div class=\"verdict {}\"><p class=\"headline\">{}.</p><p class=\"advice\">{}.</p>{}</div>\n",
                     name_of(report.level), escape_html(report.headline), escape_html(report.advice), remarks);
}

std::string format_tiles(const CalibrationReport& report) {
  std::string tiles;
  for (const SensorSummary& sensor : report.sensors) {
    const double share = 100.0 * sensor.corners_used / std::max(1, sensor.corners_found);
    tiles += format_tile(format_number(sensor.rms_px), "px",
                         fmt::format("{}: reprojection rms on {:.1f} % of the corners", sensor.name, share));
  }
  if (std::isfinite(report.left_out_rms_px))
    tiles += format_tile(format_number(report.left_out_rms_px), "px", "rms of poses that were left out");
  return "<div class=\"tiles\">" + tiles + "</div>\n";
}

std::string format_sensors(const CalibrationReport& report) {
  std::string rows;
  for (const SensorSummary& s : report.sensors)
    rows += fmt::format("<tr><td>{}</td>{}{}{}{}{}{}</tr>\n", escape_html(s.name), cell(fmt::format("{}", s.pictures)),
                        cell(fmt::format("{}", s.usable)), cell(fmt::format("{:.0f}", s.tilted_poses)),
                        cell(fmt::format("{}", s.corners_found)), cell(fmt::format("{}", s.corners_used)),
                        cell(format_number(s.rms_px)));
  return "<table><tr><th>sensor</th><th class=\"n\">pictures</th><th class=\"n\">usable</th><th class=\"n\">tilted</th>"
         "<th class=\"n\">corners found</th><th class=\"n\">used</th><th class=\"n\">rms, px</th></tr>\n" +
         rows + "</table>\n";
}

// ---- residuals ----

/// Mean error of the corners in each cell of a picture, as an arrow.
std::string format_arrows(const Bundle& bundle, int sensor, double rms_px) {
  constexpr int columns = 16;
  const Scanner model(bundle.sensors[std::size_t(sensor)].model);
  const double width = 360, scale = width / model.width(), height = model.height() * scale;
  const double side = width / columns, exaggeration = 0.7 * side / std::max(1e-9, rms_px);
  struct Sum {
    Eigen::Vector2d place = Eigen::Vector2d::Zero(), error = Eigen::Vector2d::Zero();
    int count = 0;
  };
  std::map<std::pair<int, int>, Sum> sums;
  for (const Observation& seen : bundle.observations) {
    if (seen.sensor != sensor || !seen.used) continue;
    const Eigen::Vector2d place = scale * (seen.pixel + Eigen::Vector2d(0.5, 0.5));
    Sum& sum = sums[{int(place.x() / side), int(place.y() / side)}];
    sum.place += place;
    sum.error += bundle.residual(seen);
    ++sum.count;
  }
  std::string lines;
  for (const auto& [where, sum] : sums) {
    const Eigen::Vector2d from = sum.place / sum.count, to = from + exaggeration * sum.error / sum.count;
    lines += fmt::format(
        R"(<path class="curve" d="M{:.1f} {:.1f}L{:.1f} {:.1f}"/><circle cx="{:.1f}" cy="{:.1f}" r="{:.1f}"/>)",
        from.x(), from.y(), to.x(), to.y(), from.x(), from.y(),
        std::min(3.0, 0.8 + 0.3 * std::sqrt(double(sum.count))));
  }
  return fmt::format(
      R"(<figure><svg class="plot" viewBox="-2 -2 {:.0f} {:.0f}" role="img"><path class="grid" d="M0 0H{:.0f}V{:.0f}H0Z"/>{}</svg>)"
      "<figcaption><b>Mean error by place in the picture.</b> Arrows are {:.0f} times as long as the errors; larger "
      "dots "
      "stand for more corners. Arrows that turn about or point to the middle are distortion that the model misses; no "
      "dots "
      "mean no corners.</figcaption></figure>\n",
      width + 4, height + 4, width, height, lines, exaggeration / scale);
}

struct Bin {
  int count = 0;
  double radial = 0, squares = 0;
};

/// Mean radial error and rms by distance from the principal point.
std::string format_radius(const Bundle& bundle, int sensor, double rms_px) {
  constexpr int bins = 14;
  const Scanner model(bundle.sensors[std::size_t(sensor)].model);
  const Eigen::Vector2d middle(0.5 * model.width(), 0.5 * model.height());
  std::array<Bin, bins> sums{};
  for (const Observation& seen : bundle.observations) {
    if (seen.sensor != sensor || !seen.used) continue;
    const Eigen::Vector2d arm = seen.pixel - middle, error = bundle.residual(seen);
    Bin& bin = sums[std::size_t(std::clamp(int(bins * arm.norm() / middle.norm()), 0, bins - 1))];
    ++bin.count;
    bin.radial += error.dot(arm.normalized());
    bin.squares += error.squaredNorm();
  }
  const double top = 2 * rms_px, base = 100, left = 40, step = 310.0 / bins;
  const auto y_of = [&](double px) { return base - std::clamp(px / top, -1.0, 1.0) * 88; };
  std::string bars, line;
  for (int k = 0; k < bins; ++k) {
    const Bin& bin = sums[std::size_t(k)];
    if (bin.count == 0) continue;
    const double x = left + (k + 0.5) * step;
    bars += fmt::format(R"(<path class="area" d="M{:.1f} {:.1f}h{:.1f}V{}h{:.1f}Z"/>)", x - 0.4 * step,
                        y_of(std::sqrt(bin.squares / bin.count)), 0.8 * step, base, -0.8 * step);
    line += fmt::format("{}{:.1f} {:.1f}", line.empty() ? "M" : "L", x, y_of(bin.radial / bin.count));
  }
  return fmt::format(
      R"(<figure><svg class="plot" viewBox="0 0 360 210" role="img">{}<path class="grid" d="M{} {}H350"/>)"
      R"(<path class="curve" d="{}"/><text x="20" y="16">{}</text><text x="20" y="{}">0</text><text x="20" y="192">{}</text>)"
      R"(<text x="{}" y="206">middle</text><text x="325" y="206">corner</text></svg>)"
      "<figcaption><b>Error by distance from the middle.</b> Bars: rms [px]. Line: mean error away from the middle; "
      "where it "
      "leaves zero, the lens does something that the model does not know.</figcaption></figure>\n",
      bars, left, base, line, format_number(top), base + 4, format_number(-top), left + 20);
}

std::string format_residuals(const CalibrationReport& report) {
  std::string html;
  for (std::size_t k = 0; k < report.sensors.size(); ++k) {
    const SensorSummary& sensor = report.sensors[k];
    const Bundle& bundle = report.calibration->bundle;
    html +=
        fmt::format("<h3>{}</h3>\n", escape_html(sensor.name)) +
        format_row("two", format_arrows(bundle, int(k), sensor.rms_px) + format_radius(bundle, int(k), sensor.rms_px));
  }
  return html;
}

// ---- accuracy ----

/// Larger, so that a coarse map can be looked at.
Image<float> enlarged(const Image<float>& map, int factor) {
  Image<float> large(map.width() * factor, map.height() * factor);
  for (int y = 0; y < large.height(); ++y)
    for (int x = 0; x < large.width(); ++x) large(x, large.height() - 1 - y) = map(x / factor, y / factor);
  return large;
}

std::string format_map(const Image<float>& map, const std::string& unit, const std::string& title,
                       const std::string& caption, const PictureEncoder& encoder) {
  Range range = range_of(map, 0.02);
  range.low = 0;
  PictureFigure figure = map_figure(enlarged(map, 12), Ramp::sequential, range, unit, encoder);
  figure.title = title;
  figure.caption = caption;
  return format_figure(figure);
}

std::string format_accuracy(const CalibrationReport& report, const PictureEncoder& encoder) {
  std::string points, scan;
  for (const AccuracyMap& map : report.accuracy) {
    if (map.point_mm.empty()) continue;
    const std::string height = fmt::format("{:.0f} mm above the table.", map.height_mm);
    const std::string where = fmt::format("x from {:.0f} mm to the right, y from {:.0f} mm upwards, {:.0f} mm a cell.",
                                          map.low_mm.x(), map.low_mm.y(), map.spacing_mm);
    points += format_map(map.point_mm, "mm", "Points, " + height, where, encoder);
    if (!map.scan_px.empty())
      scan += format_map(map.scan_px, "px", "Places in the scan, " + height, "Of a triangulated point.", encoder);
  }
  return format_row("three", points) + format_row("three", scan);
}

// ---- tables ----

std::string format_parameters(const BundleSolution& solution) {
  std::string rows;
  for (std::size_t k = 0; k < solution.parameters.size(); ++k) {
    const Parameter& p = solution.parameters[k];
    if (p.owner.starts_with("pose ")) break;
    const auto i = static_cast<Eigen::Index>(k);
    rows += fmt::format("<tr><td>{}</td><td>{}</td>{}{}<td><span class=\"u\">{}</span></td></tr>\n",
                        escape_html(p.owner), p.name, cell(fmt::format("{:.8g}", p.value)),
                        cell(fmt::format("{:.2g}", std::sqrt(solution.covariance(i, i)))), p.unit);
  }
  return "<table><tr><th>of</th><th>parameter</th><th class=\"n\">value</th><th class=\"n\">standard deviation</th>"
         "<th></th></tr>\n" +
         rows + "</table>\n";
}

std::string format_correlations(const BundleSolution& solution) {
  std::string rows;
  const auto& c = solution.covariance;
  for (Eigen::Index i = 0; i < c.rows(); ++i) {
    const Parameter& a = solution.parameters[std::size_t(i)];
    if (a.owner.starts_with("pose ")) break;
    for (Eigen::Index j = 0; j < i; ++j) {
      const double correlation = c(i, j) / std::sqrt(c(i, i) * c(j, j));
      if (!(std::abs(correlation) > strong_correlation)) continue;
      const Parameter& b = solution.parameters[std::size_t(j)];
      rows += fmt::format("<tr><td>{} {}</td><td>{} {}</td>{}</tr>\n", escape_html(b.owner), b.name,
                          escape_html(a.owner), a.name, cell(fmt::format("{:.3f}", correlation)));
    }
  }
  if (rows.empty()) return "";
  return "<details><summary>Parameters that go together (correlation above 0.9)</summary><table>" + rows +
         "</table></details>\n";
}

std::string format_outliers(const CalibrationReport& report) {
  struct Outlier {
    double length;
    std::string row;
  };
  std::vector<Outlier> outliers;
  const Bundle& bundle = report.calibration->bundle;
  for (const Observation& seen : bundle.observations) {
    if (seen.used) continue;
    const auto& pictures = report.input->sensors[std::size_t(seen.sensor)].pictures;
    const auto picture = std::ranges::find(pictures, seen.pose, &BoardPicture::pose);
    const double length = bundle.residual(seen).norm();
    outliers.push_back({length, fmt::format("<tr><td>{}</td>{}{}{}</tr>\n", escape_html(picture->file),
                                            cell(fmt::format("{}", seen.corner)),
                                            cell(fmt::format("{:.1f}, {:.1f}", seen.pixel.x(), seen.pixel.y())),
                                            cell(format_number(length)))});
  }
  if (outliers.empty()) return "";
  std::ranges::sort(outliers, std::greater<>{}, &Outlier::length);
  std::string rows;
  for (std::size_t k = 0; k < std::min(outliers.size(), most_outliers_listed); ++k) rows += outliers[k].row;
  return fmt::format(
      "<details><summary>{} corners left out</summary><table><tr><th>picture</th><th class=\"n\">corner</th>"
      "<th class=\"n\">seen at, px</th><th class=\"n\">off by, px</th></tr>\n{}</table></details>\n",
      outliers.size(), rows);
}

std::string format_refused(const CalibrationInput& input) {
  std::string rows;
  for (const SensorPictures& sensor : input.sensors)
    for (const BoardPicture& picture : sensor.pictures)
      if (!picture.view.problem.empty())
        rows += fmt::format("<tr><td>{}</td><td>{}</td></tr>\n", escape_html(picture.file),
                            escape_html(picture.view.problem));
  return rows.empty() ? "" : "<h3>Pictures that were not used</h3><table>" + rows + "</table>\n";
}

std::string format_trials(const Calibration& calibration) {
  std::string rows;
  for (const ScannerTrial& trial : calibration.trials)
    rows += fmt::format("<tr><td>{}{}</td>{}</tr>\n", name_of(trial.model), trial.chosen ? " (chosen)" : "",
                        cell(format_number(trial.rms_px) + " px"));
  return rows.empty()
             ? ""
             : "<h3>How the scanner maps space</h3><p class=\"lead\">Rms on pictures that the model had not seen."
               "</p><table>" +
                   rows + "</table>\n";
}

std::string format_page(const CalibrationReport& report, const PictureEncoder& encoder) {
  const Calibration& calibration = *report.calibration;
  std::string html = format_page_head("Calibration", report.title);
  html += format_verdict(report) + format_tiles(report);
  html += format_section(
      "Pictures", "What was found in them. Tilted: by more than 10 degrees against the mean of all.",
      format_sensors(report) + format_trials(calibration) + format_refused(*report.input) + format_outliers(report));
  html += format_section("What is left", "Where corners were seen minus where the calibrated rig expects them.",
                         format_residuals(report));
  html += format_section(
      "Predicted accuracy",
      "Standard deviation that the calibration's own uncertainty gives to triangulated points, in space, "
      "and to their places in the scan. Noise of the measurement comes on top.",
      format_accuracy(report, encoder));
  html +=
      format_section("Parameters",
                     "In the rig's frame, which the pose on the table defines. turn_x, ... are small turns about the "
                     "rig's axes.",
                     format_parameters(calibration.solution) + format_correlations(calibration.solution));
  return html + fmt::format("<footer>{}</footer>\n</body></html>\n", escape_html(report.program));
}

}  // namespace

void write_calibration_report(const std::filesystem::path& folder, const CalibrationReport& report) {
  write_bytes(folder / "report.html", format_page(report, PictureEncoder(folder)));
  write_bytes(folder / "report.json", format_calibration_json(report));
}

}  // namespace pagesweep
