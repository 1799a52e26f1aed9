// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/report/plan_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/json_file.h"
#include "pagesweep/report/html.h"

namespace pagesweep {
namespace {

using Json = nlohmann::ordered_json;

/// A way to measure a point, and what it is called.
struct Method {
  double SpotAccuracy::* field;
  const char* name;  ///< key for scripts
  const char* what;
  const char* caption;
};
constexpr Method methods[] = {
    {&SpotAccuracy::stereo_mm, "stereo", "two cameras", "Both cameras' times alone; the light need not be known."},
    {&SpotAccuracy::joint_mm, "joint", "two cameras and the sheet of light",
     "Both cameras' times, and the sheet of light known exactly."},
    {&SpotAccuracy::section_mm, "section", "one camera and the sheet of light",
     "The better camera's times alone, and the sheet of light known exactly."}};

/// Those that the rig can have: nothing is said of two cameras where there is one.
std::vector<Method> methods_of(const Plan& plan) {
  return plan.request.cameras.size() == 2 ? std::vector<Method>(std::begin(methods), std::end(methods))
                                          : std::vector<Method>{methods[2]};
}

Spread height_spread(const HeightPlan& height, const Method& method) { return spread_of({height}, method.field, true); }

struct Share {
  const char* name;  ///< key for scripts
  const char* what;
  double share;  ///< of the time value's variance
};
std::vector<Share> noise_shares(const TimeVariance& time) {
  std::vector<Share> shares{{"shot", "photon noise", time.shot / time.total()},
                            {"read", "the sensor's read noise", time.read / time.total()},
                            {"rounding", "rounding to gray values", time.rounding / time.total()}};
  std::stable_sort(shares.begin(), shares.end(), [](const Share& a, const Share& b) { return a.share > b.share; });
  return shares;
}

std::vector<Variation> best_first(std::vector<Variation> variations) {
  std::stable_sort(variations.begin(), variations.end(),
                   [](const Variation& a, const Variation& b) { return a.ratio < b.ratio; });
  return variations;
}

/// "0.0632": three digits, for people.
std::string digits(double value) { return std::isfinite(value) ? fmt::format("{:.3g}", value) : "-"; }
std::string ratio(double value) { return std::isfinite(value) ? fmt::format("{:.2f}", value) : "-"; }
std::string percent(double share) { return fmt::format("{:.3g} %", 100 * share); }

// Sentences that terminal and page share ------------------------------------------------------------------------------

std::string headline(const Plan& plan) {
  const Spread all = spread_of(plan.heights, plan.method(), true);
  return fmt::format("Height error of a point on paper: {} mm, {} mm at worst (one standard deviation)",
                     digits(all.median), digits(all.worst));
}

std::string limit(const Plan& plan) {
  const auto shares = noise_shares(plan.time);
  return fmt::format("A time value is certain to {} frames; {} makes {} of its variance, {} {}, {} {}",
                     digits(plan.time_sigma()), shares[0].what, percent(shares[0].share), shares[1].what,
                     percent(shares[1].share), shares[2].what, percent(shares[2].share));
}

std::string best_stripe(const Plan& plan) {
  return fmt::format(
      "At this speed and brightness a stripe of {} mm ({} frames) would be the best: {} times the error. Narrower ones "
      "pass between the frames",
      digits(plan.best_stripe_mm), digits(plan.best_stripe_mm / plan.mm_per_frame), ratio(plan.best_stripe_ratio));
}

// plan.json -----------------------------------------------------------------------------------------------------------

/// JSON knows neither NaN nor infinity. Four digits are more than a prediction has.
Json number(double value) {
  return std::isfinite(value) ? Json(std::stod(fmt::format("{:.4g}", value))) : Json(nullptr);
}

Json to_json(const Spread& spread) { return {{"median", number(spread.median)}, {"worst", number(spread.worst)}}; }

Json to_json(const Image<float>& map) {
  Json rows = Json::array();
  for (int y = 0; y < map.height(); ++y) {
    Json row = Json::array();
    for (const float value : map.row(y)) row.push_back(number(value));
    rows.push_back(std::move(row));
  }
  return rows;
}

Json to_json(const HeightPlan& height, const std::vector<Method>& known, bool with_maps) {
  Json json{{"height_mm", height.height_mm},
            {"seen_by_two", number(height.share_seen_by(2))},
            {"seen_by_one", number(height.share_seen_by(1))},
            {"seen_by_none", number(height.share_seen_by(0))},
            {"match_px", to_json(spread_of({height}, &SpotAccuracy::match_px, false))}};
  for (const Method& method : known)
    json[method.name] = {{"height_mm", to_json(height_spread(height, method))},
                         {"along_ray_mm", to_json(spread_of({height}, method.field, false))}};
  if (with_maps)
    for (const Method& method : known) json["maps"][method.name] = to_json(height.height_map_of(method.field));
  return json;
}

Json request_json(const Plan& plan) {
  const RecordingPlan& recording = plan.request.recording;
  const TableExtent& table = plan.request.table;
  return {{"amplitude", recording.amplitude},
          {"full_well_electrons", recording.full_well_electrons},
          {"read_noise_electrons", recording.read_noise_electrons},
          {"bits", recording.bits},
          {"stripe_mm", recording.stripe_mm},
          {"exposure_frames", recording.exposure_frames},
          {"mm_per_frame", number(plan.mm_per_frame)},
          {"baseline_mm", number(plan.baseline_mm)},
          {"table_mm", {table.width_mm, table.depth_mm}},
          {"center_mm", {table.center_x_mm, table.center_y_mm}},
          {"grid_mm", plan.request.grid_mm}};
}

Json to_json(const Plan& plan, bool with_maps) {
  Json json{{"format", "pagesweep-plan"}, {"version", 1}, {"plan", request_json(plan)}};
  json["height_error_mm"] = to_json(spread_of(plan.heights, plan.method(), true));
  json["time"] = {{"sigma_frames", number(plan.time_sigma())}, {"stripe_frames", number(plan.stripe_frames)}};
  for (const Share& share : noise_shares(plan.time))
    json["time"]["share_of_variance"][share.name] = number(share.share);
  json["heights"] = Json::array();
  for (const HeightPlan& height : plan.heights) json["heights"].push_back(to_json(height, methods_of(plan), with_maps));
  for (const Variation& variation : plan.variations)
    json["variations"][variation.name] = {{"what", variation.what}, {"ratio", number(variation.ratio)}};
  json["best_stripe"] = {{"mm", number(plan.best_stripe_mm)}, {"ratio", number(plan.best_stripe_ratio)}};
  return json;
}

// plan.html -----------------------------------------------------------------------------------------------------------

constexpr int map_px = 640;

/// Bilinear, with the same missing values.
Image<float> enlarge(const Image<float>& map, int factor) {
  Image<float> large(map.width() * factor, map.height() * factor);
  for (int y = 0; y < large.height(); ++y)
    for (int x = 0; x < large.width(); ++x) {
      const double u = std::clamp((x + 0.5) / factor - 0.5, 0.0, map.width() - 1.0);
      const double v = std::clamp((y + 0.5) / factor - 0.5, 0.0, map.height() - 1.0);
      const int i = std::min(static_cast<int>(u), std::max(0, map.width() - 2));
      const int j = std::min(static_cast<int>(v), std::max(0, map.height() - 2));
      const int right = std::min(i + 1, map.width() - 1), below = std::min(j + 1, map.height() - 1);
      const double a = u - i, b = v - j;
      large(x, y) = static_cast<float>((1 - b) * ((1 - a) * map(i, j) + a * map(right, j)) +
                                       b * ((1 - a) * map(i, below) + a * map(right, below)));
    }
  return large;
}

/// Of all heights and methods, so that colours can be compared.
Range range_of(const Plan& plan) {
  std::vector<float> values;
  for (const HeightPlan& height : plan.heights)
    for (const Method& method : methods_of(plan)) {
      const Image<float> map = height.height_map_of(method.field);
      values.insert(values.end(), map.pixels().begin(), map.pixels().end());
    }
  Image<float> all(static_cast<int>(values.size()), 1);
  std::copy(values.begin(), values.end(), all.data());
  return range_of(all, 0.002);
}

std::string format_map(const HeightPlan& height, const Method& method, Range range, const PictureEncoder& encoder) {
  const Image<float> map = height.height_map_of(method.field);
  const int factor = std::max(1, map_px / std::max(map.width(), map.height()));
  const double step = round_step(range, 12);
  PictureFigure figure =
      photo_figure(draw_contours(enlarge(map, factor), Ramp::sequential, range, step), map_px, encoder);
  figure.has_bar = true;
  figure.range = range;
  figure.unit = "mm";
  figure.title = fmt::format("Paper at {} mm: {}.", format_number(height.height_mm), method.what);
  const Spread spread = height_spread(height, method);
  figure.caption =
      fmt::format("{} Median {} mm, worst {} mm; a line every {} mm, gray where it cannot be measured.", method.caption,
                  format_number(spread.median), format_number(spread.worst), format_number(step));
  return format_figure(figure);
}

std::string format_maps(const Plan& plan, const PictureEncoder& encoder) {
  const Range range = range_of(plan);
  std::string html;
  for (const HeightPlan& height : plan.heights) {
    std::string figures;
    for (const Method& method : methods_of(plan)) figures += format_map(height, method, range, encoder);
    html += format_row(plan.request.cameras.size() == 2 ? "three" : "two", figures);
  }
  return html;
}

std::string format_tiles(const Plan& plan) {
  const RecordingPlan& recording = plan.request.recording;
  const Spread match = spread_of(plan.heights, &SpotAccuracy::match_px, false);
  std::string tiles = format_tile(digits(plan.time_sigma()), "frames", "standard deviation of a time value");
  if (plan.request.cameras.size() == 2) {
    tiles += format_tile(digits(match.median), "px", "of a match along the epipolar line");
    tiles += format_tile(digits(plan.baseline_mm), "mm", "between the cameras");
  }
  tiles += format_tile(digits(recording.stripe_mm), "mm", fmt::format("stripe, {} frames", digits(plan.stripe_frames)));
  tiles += format_tile(digits(plan.mm_per_frame), "mm", "a frame");
  tiles +=
      format_tile(fmt::format("{}", recording.bits), "bit",
                  fmt::format("full well {} electrons, read noise {}", format_number(recording.full_well_electrons),
                              digits(recording.read_noise_electrons)));
  return "<div class=\"tiles\">" + tiles + "</div>\n";
}

std::string format_heights(const Plan& plan) {
  std::string html = "<table><tr><th>paper at</th><th class=\"n\">seen by both</th><th class=\"n\">by one</th>";
  for (const Method& method : methods_of(plan))
    html += fmt::format("<th class=\"n\">{}, mm</th>", escape_html(method.what));
  html += "<th class=\"n\">match, px</th></tr>\n";
  for (const HeightPlan& height : plan.heights) {
    html +=
        fmt::format("<tr><td>{} mm</td><td class=\"n\">{}</td><td class=\"n\">{}</td>", format_number(height.height_mm),
                    percent(height.share_seen_by(2)), percent(height.share_seen_by(1)));
    for (const Method& method : methods_of(plan)) {
      const Spread spread = height_spread(height, method);
      html += fmt::format("<td class=\"n\">{} <span class=\"u\">to {}</span></td>", format_number(spread.median),
                          format_number(spread.worst));
    }
    html += fmt::format("<td class=\"n\">{}</td></tr>\n",
                        format_number(spread_of({height}, &SpotAccuracy::match_px, false).median));
  }
  return html + "</table>\n";
}

std::string format_variations(const Plan& plan) {
  std::string html = "<table><tr><th>what if: all else the same</th><th class=\"n\">height error, times</th></tr>\n";
  for (const Variation& variation : best_first(plan.variations))
    html += fmt::format("<tr><td>{}</td><td class=\"n\">{}</td></tr>\n", escape_html(variation.what),
                        ratio(variation.ratio));
  return html + fmt::format("</table>\n<p class=\"lead\">{}.</p>\n", escape_html(best_stripe(plan)));
}

std::string format_page(const Plan& plan, const std::string& title, const std::string& program,
                        const PictureEncoder& encoder) {
  std::string html = format_page_head("Accuracy plan", title);
  html += fmt::format("<div class=\"verdict good\"><p class=\"headline\">{}.</p><ul><li>{}.</li></ul></div>\n{}",
                      escape_html(headline(plan)), escape_html(limit(plan)), format_tiles(plan));
  html += format_section("Over the table",
                         "Standard deviation of the height of a point on level, blank paper, as seen from above: x to "
                         "the right, y upwards.",
                         format_maps(plan, encoder));
  html += format_section("By height", "Median over the table, and the worst spot.", format_heights(plan));
  html += format_section("What would change it",
                         "Each row is the same plan with one thing changed, computed anew. How it follows from light "
                         "and geometry: docs/derivations/accuracy.md.",
                         format_variations(plan));
  return html + fmt::format("<footer>{}</footer>\n</body></html>\n", escape_html(program));
}

}  // namespace

std::string format_plan_text(const Plan& plan) {
  std::string text = headline(plan) + ".\n" + limit(plan) + ".\n\n";
  text += fmt::format("  {:<40}", "paper at");
  for (const HeightPlan& height : plan.heights) text += fmt::format("{:>19}", digits(height.height_mm) + " mm");
  const auto row = [&](const std::string& what, const auto& value_of) {
    text += fmt::format("\n  {:<40}", what);
    for (const HeightPlan& height : plan.heights) text += fmt::format("{:>19}", value_of(height));
  };
  row("seen by both cameras", [](const HeightPlan& height) { return percent(height.share_seen_by(2)); });
  row("seen by one", [](const HeightPlan& height) { return percent(height.share_seen_by(1)); });
  for (const Method& method : methods_of(plan))
    row(fmt::format("mm, {}", method.what), [&](const HeightPlan& height) {
      const Spread spread = height_spread(height, method);
      return fmt::format("{} to {}", digits(spread.median), digits(spread.worst));
    });
  text += "\n\nHeight error, times, if all else stays:\n";
  for (const Variation& variation : best_first(plan.variations))
    text += fmt::format("  {:>5}  {}\n", ratio(variation.ratio), variation.what);
  return text + best_stripe(plan) + ".\n";
}

std::string format_plan_json(const Plan& plan, bool with_maps) { return format_json(to_json(plan, with_maps)); }

void write_plan(const std::filesystem::path& folder, const Plan& plan, const std::string& title,
                const std::string& program) {
  write_bytes(folder / "plan.html", format_page(plan, title, program, PictureEncoder(folder)));
  write_json(folder / "plan.json", to_json(plan, true));
}

}  // namespace pagesweep
