// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>

#include "pagesweep/acceptance/acceptance.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/report/html.h"

namespace pagesweep {
namespace {

std::string_view colour_class(AcceptanceVerdict verdict) {
  switch (verdict) {
    case AcceptanceVerdict::passed:
      return "good";
    case AcceptanceVerdict::failed:
      return "scan_again";
    case AcceptanceVerdict::no_limits:
      break;
  }
  return "";
}

std::string format_verdict(const Acceptance& acceptance) {
  std::string remarks;
  for (const std::string& remark : acceptance.remarks) remarks += "<li>" + escape_html(remark) + "</li>";
  if (!remarks.empty()) remarks = "<ul>" + remarks + "</ul>";
  return fmt::format("<div class=\"verdict {}\"><p class=\"headline\">{}.</p>{}</div>\n",
                     colour_class(acceptance.verdict), escape_html(acceptance.headline), remarks);
}

std::string name_of(const QualityParameter& parameter) {
  return parameter.symbol.empty() ? parameter.what : fmt::format("{} {}", parameter.what, parameter.symbol);
}

std::string format_tiles(const Acceptance& acceptance) {
  std::string tiles;
  for (const QualityParameter& parameter : acceptance.parameters) {
    if (parameter.symbol.empty()) continue;
    const std::string limit =
        parameter.limit > 0 ? fmt::format(", limit {} {}", format_number(parameter.limit), parameter.unit) : "";
    tiles += format_tile(format_number(parameter.worst()), parameter.unit, name_of(parameter) + limit);
  }
  return "<div class=\"tiles\">" + tiles + "</div>\n";
}

std::string cell(const std::string& value) { return "<td class=\"n\">" + value + "</td>"; }

/// A row a pose, a column a parameter; the worst and the limits below.
std::string format_parameters(const Acceptance& acceptance) {
  std::string head, worst = "<tr><td style=\"white-space:nowrap\">worst</td>",
                    limits = "<tr><td style=\"white-space:nowrap\">limit</td>", rows;
  for (const QualityParameter& parameter : acceptance.parameters) {
    head += fmt::format("<th class=\"n\" style=\"white-space:normal\">{} <span class=\"u\">{}</span></th>",
                        name_of(parameter), parameter.unit);
    worst += cell("<b>" + format_number(parameter.worst()) + "</b>");
    limits += cell(parameter.limit > 0 ? format_number(parameter.limit) : "");
  }
  for (std::size_t k = 0; k < acceptance.poses.size(); ++k) {
    rows += fmt::format("<tr><td style=\"white-space:nowrap\">{}</td>", escape_html(acceptance.poses[k].name));
    for (const QualityParameter& parameter : acceptance.parameters) rows += cell(format_number(parameter.values[k]));
    rows += "</tr>\n";
  }
  return fmt::format("<table><tr><th style=\"white-space:nowrap\">pose</th>{}</tr>\n{}{}</tr>\n{}</tr></table>\n", head,
                     rows, worst, limits);
}

/// One range of colours for all maps of a pose, so that they can be compared.
Range range_of_maps(const PoseResult& pose) {
  double most = 0;
  if (pose.plate) most = symmetric_range_of(pose.plate->map).high;
  for (const SphereResult& sphere : pose.spheres) most = std::max(most, symmetric_range_of(sphere.map).high);
  return {-most, most};
}

std::string format_map(const Image<float>& map, Range range, const std::string& title, const std::string& caption,
                       const PictureEncoder& encoder) {
  PictureFigure figure = map_figure(map, Ramp::diverging, range, "mm", encoder);
  figure.title = title;
  figure.caption = caption;
  return format_figure(figure);
}

std::string count_of(const Deviations& deviations) {
  return fmt::format("{} points, {} discarded, {} beyond reach; noise explains an rms of {} mm of {} mm.",
                     format_number(double(deviations.points)), deviations.discarded, deviations.far_points,
                     format_number(deviations.claimed_rms_mm), format_number(deviations.rms_mm));
}

std::string format_maps(const PoseResult& pose, const PictureEncoder& encoder) {
  const Range range = range_of_maps(pose);
  std::string plate, spheres;
  if (pose.plate) plate = format_map(pose.plate->map, range, "Plate.", count_of(pose.plate->deviations), encoder);
  for (std::size_t k = 0; k < pose.spheres.size(); ++k)
    spheres += format_map(pose.spheres[k].map, range, fmt::format("Sphere {}.", k + 1),
                          fmt::format("Diameter {:.3f} mm. {}", 2 * pose.spheres[k].sphere.radius_mm,
                                      count_of(pose.spheres[k].deviations)),
                          encoder);
  std::string spacing;
  if (pose.spacing)
    spacing = fmt::format(
        "<p class=\"lead\">Sphere spacing {:.4f} mm, calibrated {:.4f} mm; noise alone makes it uncertain "
        "by {} mm (1 σ).</p>\n",
        pose.spacing->measured_mm, pose.spacing->calibrated_mm, format_number(pose.spacing->noise_mm));
  return fmt::format("<h3>{}</h3>\n{}{}", escape_html(pose.name), spacing,
                     format_row(plate.empty() ? "four" : "surface", plate + spheres));
}

std::string format_all_maps(const Acceptance& acceptance, const PictureEncoder& encoder) {
  std::string html;
  for (const PoseResult& pose : acceptance.poses) html += format_maps(pose, encoder);
  return html;
}

std::vector<Figure> figures_of(const Artefact& artefact) {
  std::vector<Figure> figures;
  const auto add = [&](const std::string& what, double mm) { figures.push_back({"artefact", "", what, mm, "mm", ""}); };
  if (artefact.plate_mm) {
    add("plate, longer side", artefact.plate_mm->x());
    add("plate, shorter side", artefact.plate_mm->y());
  }
  for (std::size_t k = 0; k < artefact.sphere_diameters_mm.size(); ++k)
    add(fmt::format("sphere {}, calibrated diameter", k + 1), artefact.sphere_diameters_mm[k]);
  if (artefact.spacing_mm) add("calibrated spacing of the spheres", *artefact.spacing_mm);
  return figures;
}

std::string format_options(const std::vector<OptionValue>& options) {
  std::string rows;
  for (const OptionValue& option : options)
    rows +=
        fmt::format("<tr><td>{}</td><td>{}</td><td class=\"n\">{} <span class=\"u\">{}</span></td></tr>\n",
                    escape_html(option.station), escape_html(option.name),
                    std::visit([](const auto& value) { return escape_html(fmt::format("{}", value)); }, option.value),
                    escape_html(option.unit));
  return "<details><summary>All options of this test</summary><table>" + rows + "</table></details>\n";
}

std::string format_page(const Acceptance& acceptance, const AcceptanceReport& report, const PictureEncoder& encoder) {
  const std::string& name = acceptance.artefact.name;
  std::string html =
      format_page_head("Acceptance test after VDI/VDE 2634 part 2", name.empty() ? "Acceptance test" : name);
  html += format_verdict(acceptance) + format_tiles(acceptance);
  html +=
      format_section("Quality parameters",
                     "F and PF: range of the distances of the points to the best plane or sphere. PS: measured minus "
                     "calibrated diameter. SD: measured minus calibrated distance of the spheres' centres. Rms over "
                     "claim: 1 where the points' own standard deviations explain all.",
                     format_parameters(acceptance));
  html +=
      format_section("Deviations",
                     "Mean distance of the points to the fitted plane or sphere: red towards the cameras, blue away "
                     "from them. Fine grain is noise; anything with a shape is a systematic error.",
                     format_all_maps(acceptance, encoder));
  html += format_section("Details", "Calibrated values, and how the test was made; docs/acceptance.md explains it.",
                         format_figures(figures_of(acceptance.artefact)) + format_options(report.options));
  return html + fmt::format("<footer>{}</footer>\n</body></html>\n", escape_html(report.program));
}

}  // namespace

void write_acceptance(const std::filesystem::path& folder, const Acceptance& acceptance,
                      const AcceptanceReport& report) {
  write_bytes(folder / "acceptance.html", format_page(acceptance, report, PictureEncoder(folder)));
  write_bytes(folder / "acceptance.json", format_acceptance_json(acceptance, report));
}

}  // namespace pagesweep
