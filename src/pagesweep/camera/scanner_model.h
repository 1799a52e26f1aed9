// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string_view>

#include "pagesweep/base/enum_names.h"

namespace pagesweep {

/// How a scanner maps space: the models that Scanner::Model holds, by the names that files and options give them.
enum class ScannerModel { brown_conrady, pushbroom, rotating_line };
constexpr auto names_of(ScannerModel) {
  return std::array<std::string_view, 3>{"brown-conrady", "pushbroom", "rotating-line"};
}

}  // namespace pagesweep
