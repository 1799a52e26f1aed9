// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/truth_file.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "pagesweep/io/float_tiff.h"
#include "pagesweep/io/json_file.h"
#include "pagesweep/io/json_reader.h"

namespace pagesweep {
namespace {

constexpr double largest = 1e6;

TruthPage read_page(const JsonReader& json) {
  TruthPage page;
  page.index = json.at("index").integer(1, 1000);
  page.pixels_per_mm = json.at("pixels_per_mm").number(1e-3, largest);
  if (const auto subsampling = json.find("points_subsampling"))
    page.points_subsampling = subsampling->integer(1, 10000);
  if (const auto text = json.find("text")) page.text = text->text();
  return page;
}

TruthProfile read_profile(const JsonReader& json) {
  TruthProfile profile;
  profile.start_frames = json.at("start_frames").number(-largest, largest);
  profile.step_frames = json.at("step_frames").number(1e-6, largest);
  profile.values = json.at("values").numbers();
  if (profile.values.size() < 2) throw json.at("values").error("expected at least 2 numbers");
  return profile;
}

}  // namespace

std::filesystem::path Truth::camera_points_path(std::string_view camera) const {
  return folder / fmt::format("{}_points.tiff", camera);
}
std::filesystem::path Truth::page_path(int index) const { return folder / fmt::format("page_{}.png", index); }
std::filesystem::path Truth::page_scan_map_path(int index) const {
  return folder / fmt::format("page_{}_scanmap.tiff", index);
}
std::filesystem::path Truth::page_points_path(int index) const {
  return folder / fmt::format("page_{}_points.tiff", index);
}

Truth read_truth(const std::filesystem::path& folder_or_file) {
  const bool is_folder = std::filesystem::is_directory(folder_or_file);
  const auto file = is_folder ? folder_or_file / "truth.json" : folder_or_file;
  const JsonReader json = JsonReader::read(file);
  json.expect_format("pagesweep-truth", 1);
  Truth truth;
  truth.folder = file.parent_path();
  for (const JsonReader& item : json.at("pages").items()) {
    truth.pages.push_back(read_page(item));
    const auto is_same = [&](const TruthPage& page) { return page.index == truth.pages.back().index; };
    if (std::any_of(truth.pages.begin(), truth.pages.end() - 1, is_same))
      throw item.at("index").error(
          fmt::format("expected another index: there is a page {} already", truth.pages.back().index));
  }
  if (const auto stripe = json.find("stripe"))
    truth.stripe = {stripe->at("mm_per_frame").number(-largest, largest), stripe->at("fwhm_mm").number(0, largest)};
  if (const auto sensor = json.find("sensor"))
    truth.sensor = {sensor->at("gain_e_per_gray").number(0, largest), sensor->at("read_noise_gray").number(0, largest)};
  if (const auto profile = json.find("profile")) truth.profile = read_profile(*profile);
  return truth;
}

void write_truth(const Truth& truth) {
  nlohmann::ordered_json json = {{"format", "pagesweep-truth"}, {"version", 1}};
  json["pages"] = nlohmann::ordered_json::array();
  for (const TruthPage& page : truth.pages) {
    nlohmann::ordered_json item = {
        {"index", page.index}, {"pixels_per_mm", page.pixels_per_mm}, {"points_subsampling", page.points_subsampling}};
    if (!page.text.empty()) item["text"] = page.text;
    json["pages"].push_back(std::move(item));
  }
  if (truth.stripe) json["stripe"] = {{"mm_per_frame", truth.stripe->mm_per_frame}, {"fwhm_mm", truth.stripe->fwhm_mm}};
  if (truth.sensor)
    json["sensor"] = {{"gain_e_per_gray", truth.sensor->gain_e_per_gray},
                      {"read_noise_gray", truth.sensor->read_noise_gray}};
  if (truth.profile)
    json["profile"] = {{"start_frames", truth.profile->start_frames},
                       {"step_frames", truth.profile->step_frames},
                       {"values", truth.profile->values}};
  write_json(truth.folder / "truth.json", json);
}

Image<Eigen::Vector3f> read_camera_points(const Truth& truth, std::string_view camera) {
  return read_vector_tiff(truth.camera_points_path(camera));
}

ScanMap read_page_scan_map(const Truth& truth, int index) { return read_scan_map(truth.page_scan_map_path(index)); }

Image<Eigen::Vector3f> read_page_points(const Truth& truth, int index) {
  return read_vector_tiff(truth.page_points_path(index));
}

}  // namespace pagesweep
