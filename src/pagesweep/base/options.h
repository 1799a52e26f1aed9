// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace pagesweep {

/// Options structs stand beside the function they serve and describe themselves, so that the command
/// line, the report and the documentation are made from the one list:
///
///     struct TimingOptions {
///       double min_amplitude = 8;
///       template <class Visitor> void describe(Visitor&& visit) {
///         visit("min-amplitude", min_amplitude, "gray values", "a bell that rises less is too dark to be measured");
///       }
///     };
///
/// visit(name, field, unit, help) is called once a field. Fields are bool, int, double, std::string or an
/// enum E with `constexpr auto names_of(E)` (see base/enum_names.h). Unit is "" where there is none.

}  // namespace pagesweep
