// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/data/transfer_curve.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string_view>

namespace pagesweep {
namespace {

constexpr int cells = 4096;

std::vector<double> tabulate(const std::function<double(double)>& light) {
  std::vector<double> lights(cells + 1);
  double highest = 0;
  for (int i = 0; i <= cells; ++i) {
    highest = std::clamp(light(double(i) / cells), highest, 1.0);
    lights[static_cast<std::size_t>(i)] = highest;
  }
  return lights;
}

double srgb_light(double x) { return x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4); }

/// The bytes of a profile: big-endian numbers, and nothing beyond its end (ICC.1:2022, 4).
class ProfileBytes {
 public:
  explicit ProfileBytes(std::span<const std::byte> bytes) : bytes_(bytes) {}

  std::uint32_t number(std::size_t at, int count) const {
    std::uint32_t value = 0;
    for (int k = 0; k < count; ++k)
      value = value << 8 | std::to_integer<std::uint32_t>(bytes_[at + static_cast<std::size_t>(k)]);
    return value;
  }
  bool holds(std::size_t at, std::size_t count) const { return at <= bytes_.size() && count <= bytes_.size() - at; }
  bool says(std::size_t at, std::string_view text) const {
    if (!holds(at, text.size())) return false;
    return std::equal(text.begin(), text.end(), bytes_.begin() + static_cast<std::ptrdiff_t>(at),
                      [](char a, std::byte b) { return static_cast<std::byte>(a) == b; });
  }
  double fixed(std::size_t at) const { return static_cast<std::int32_t>(number(at, 4)) / 65536.0; }

 private:
  std::span<const std::byte> bytes_;
};

/// Where the data of the first of these tags begin; nothing if there is none.
std::optional<std::size_t> find_tag(const ProfileBytes& profile, std::span<const std::string_view> names) {
  if (!profile.holds(128, 4)) return std::nullopt;
  const std::size_t count = std::min<std::uint32_t>(profile.number(128, 4), 200);
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t entry = 132 + 12 * k;
    if (!profile.holds(entry, 12)) break;
    if (std::ranges::any_of(names, [&](std::string_view name) { return profile.says(entry, name); }))
      return profile.number(entry + 4, 4);
  }
  return std::nullopt;
}

std::optional<std::vector<double>> read_curve(const ProfileBytes& profile, std::size_t at) {
  if (!profile.holds(at, 12)) return std::nullopt;
  const std::size_t count = profile.number(at + 8, 4);
  if (count == 0) return tabulate([](double x) { return x; });
  if (!profile.holds(at + 12, 2) || (count > 1 && (count > 65536 || !profile.holds(at + 12, 2 * count))))
    return std::nullopt;
  if (count == 1) {
    const double gamma = profile.number(at + 12, 2) / 256.0;
    return gamma > 0.1 ? std::optional(tabulate([&](double x) { return std::pow(x, gamma); })) : std::nullopt;
  }
  return tabulate([&](double x) {
    const double place = x * static_cast<double>(count - 1);
    const auto k = std::min(static_cast<std::size_t>(place), count - 2);
    const double low = profile.number(at + 12 + 2 * k, 2), high = profile.number(at + 14 + 2 * k, 2);
    return (low + (place - static_cast<double>(k)) * (high - low)) / 65535;
  });
}

/// Y = (a X + b)^g + e from d on, c X + f below (ICC.1:2022, 10.18); the simpler functions leave some out.
std::optional<std::vector<double>> read_parameters(const ProfileBytes& profile, std::size_t at) {
  constexpr std::array<std::size_t, 5> lengths{1, 3, 4, 5, 7};
  if (!profile.holds(at, 12)) return std::nullopt;
  const std::size_t kind = profile.number(at + 8, 2);
  if (kind >= lengths.size() || !profile.holds(at + 12, 4 * lengths[kind])) return std::nullopt;
  std::array<double, 7> p{1, 1, 0, 0, 0, 0, 0};  // g a b c d e f
  for (std::size_t k = 0; k < lengths[kind]; ++k) p[k] = profile.fixed(at + 12 + 4 * k);
  if (!(p[0] > 0.1) || !(p[1] > 0)) return std::nullopt;
  if (kind == 1 || kind == 2) {
    p[4] = -p[2] / p[1];
    if (kind == 2) p[5] = p[6] = p[3];
    p[3] = 0;
  }
  return tabulate(
      [&](double x) { return x >= p[4] ? std::pow(std::max(0.0, p[1] * x + p[2]), p[0]) + p[5] : p[3] * x + p[6]; });
}

}  // namespace

TransferCurve::TransferCurve() : lights_(tabulate(srgb_light)) {}

TransferCurve TransferCurve::of(const Picture& picture) {
  constexpr std::array<std::string_view, 2> names{"kTRC", "rTRC"};
  const ProfileBytes profile(picture.icc_profile);
  const auto at = find_tag(profile, names);
  std::optional<std::vector<double>> lights;
  if (at && profile.says(*at, "curv")) lights = read_curve(profile, *at);
  if (at && profile.says(*at, "para")) lights = read_parameters(profile, *at);
  // A curve that does not rise from black to white is none that light could be worked out with.
  return lights && lights->back() > 0.5 ? TransferCurve(*std::move(lights)) : TransferCurve();
}

double TransferCurve::light(double sample) const {
  const double place = std::clamp(sample, 0.0, 1.0) * cells;
  const auto k = std::min(static_cast<std::size_t>(place), std::size_t{cells - 1});
  return lights_[k] + (place - static_cast<double>(k)) * (lights_[k + 1] - lights_[k]);
}

double TransferCurve::sample(double light) const {
  const auto above = std::upper_bound(lights_.begin() + 1, lights_.end() - 1, light);
  const auto k = static_cast<std::size_t>(above - lights_.begin() - 1);
  const double rise = lights_[k + 1] - lights_[k];
  const double share = rise > 0 ? std::clamp((light - lights_[k]) / rise, 0.0, 1.0) : 0;
  return (static_cast<double>(k) + share) / cells;
}

float TransferCurve::light_of(const Picture& picture, int x, int y, int channel) const {
  return std::visit(
      [&]<class T>(const Image<T>& samples) {
        constexpr double white = std::numeric_limits<T>::max();
        return static_cast<float>(light(samples(x * picture.channels + channel, y) / white));
      },
      picture.samples);
}

std::vector<float> TransferCurve::table(int bit_depth) const {
  const int white = (1 << bit_depth) - 1;
  std::vector<float> lights(static_cast<std::size_t>(white) + 1);
  for (int i = 0; i <= white; ++i) lights[static_cast<std::size_t>(i)] = static_cast<float>(light(double(i) / white));
  return lights;
}

}  // namespace pagesweep
