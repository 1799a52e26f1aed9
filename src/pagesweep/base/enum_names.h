// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string_view>
#include <utility>

namespace pagesweep {

/// Names of an enum's values, in the order of the values, which count from 0. An enum E joins by
///     constexpr auto names_of(E) { return std::array<std::string_view, N>{"first", ...}; }
/// in namespace pagesweep.
template <class E>
constexpr std::string_view name_of(E value) {
  return names_of(E{})[static_cast<std::size_t>(value)];
}

/// The value with that name, or nothing.
template <class E>
constexpr std::optional<E> value_named(std::string_view name) {
  constexpr auto names = names_of(E{});
  for (std::size_t i = 0; i < names.size(); ++i)
    if (names[i] == name) return static_cast<E>(i);
  return std::nullopt;
}

}  // namespace pagesweep
