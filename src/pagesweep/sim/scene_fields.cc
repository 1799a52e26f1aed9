// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/scene_fields.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "pagesweep/base/error.h"
#include "pagesweep/io/atomic_file.h"

namespace pagesweep::sim {
namespace {

using nlohmann::json;

/// Every field of a scene, by place. An object here stands for an object, or for each one of a list of them.
const char* const known_fields = R"({
  "format": 0, "version": 0, "about": 0,
  "pages": {
    "width_mm": 0, "height_mm": 0, "on_block": 0,
    "shape": {
      "anchor": 0, "at_mm": 0, "turn_deg": 0, "apex_mm": 0, "slopes_deg": 0,
      "dents": {"at_mm": 0, "height_mm": 0, "radius_mm": 0, "turn_deg": 0},
      "curls": {"corner": 0, "length_mm": 0, "radius_mm": 0},
      "tears": {"corner": 0, "along_mm": 0},
      "crumple": {"folds": 0, "steepest_deg": 0, "roughness_mm": 0, "seed": 0}
    },
    "print": {
      "texts": 0, "font_size_pt": 0, "line_spacing": 0, "margins_mm": 0, "columns": 0, "footer": 0,
      "paper_albedo": 0, "ink_albedo": 0, "figures": {"kind": 0, "at_mm": 0, "size_mm": 0}
    },
    "gloss": {"strength": 0, "exponent": 0}
  },
  "spheres": {"center_mm": 0, "radius_mm": 0, "albedo": 0, "gloss": {"strength": 0, "exponent": 0}},
  "obstacles": {
    "kind": 0, "page": 0, "at_mm": 0, "turn_deg": 0, "length_mm": 0, "breadth_mm": 0, "lift_mm": 0, "albedo": 0
  },
  "table": {"albedo": 0},
  "lamp": {
    "model": 0, "first_mm": 0, "mm_per_frame": 0, "lean_deg": 0, "skew_deg": 0, "bar_height_mm": 0,
    "bar_length_mm": 0, "bar_y_mm": 0, "shape": 0, "fwhm_mm": 0, "softness": 0
  },
  "cameras": {
    "frames": 0, "rays_per_side": 0, "psf_sigma_px": 0, "ambient": 0, "paper_level": 0, "exposures": 0, "blind_mm": 0,
    "views": {
      "size_px": 0, "focal_px": 0, "principal_px": 0, "distortion": 0, "center_mm": 0, "target_mm": 0, "roll_deg": 0
    }
  },
  "sensor": {
    "bit_depth": 0, "full_well_electrons": 0, "read_noise_electrons": 0, "black_level": 0, "noisy": 0
  },
  "scanner": {
    "model": 0, "center_mm": 0, "dpi": 0, "size_mm": 0, "k1": 0, "bit_depth": 0, "rays_per_side": 0, "noise": 0
  }
})";

class FieldCheck {
 public:
  explicit FieldCheck(const std::filesystem::path& file) : file_(file) {}

  void check(const json& value, const json& known, const std::string& place) const {
    if (!known.is_object()) return;
    if (value.is_array())
      for (std::size_t i = 0; i < value.size(); ++i) check(value[i], known, fmt::format("{}[{}]", place, i));
    if (!value.is_object()) return;
    for (const auto& [name, field] : value.items()) {
      const std::string here = place.empty() ? name : place + "." + name;
      if (!known.contains(name))
        throw bad_input(file_, here, fmt::format("unknown field; known here are {}", names(known)));
      check(field, known[name], here);
    }
  }

 private:
  static std::string names(const json& known) {
    std::vector<std::string> list;
    for (const auto& [name, field] : known.items()) list.push_back(name);
    return fmt::format("{}", fmt::join(list, ", "));
  }

  const std::filesystem::path& file_;
};

}  // namespace

void require_known_scene_fields(const std::filesystem::path& file) {
  const json value = json::parse(read_bytes(file, 1 << 24), nullptr, false);
  if (!value.is_discarded()) FieldCheck(file).check(value, json::parse(known_fields), "");
}

}  // namespace pagesweep::sim
