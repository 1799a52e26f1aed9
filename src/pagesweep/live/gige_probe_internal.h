// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

namespace pagesweep {

/// What stands at a network address.
enum class GigeAnswer {
  none,   ///< nothing that speaks GigE Vision's control protocol
  free,   ///< a camera that nobody controls
  taken,  ///< a camera that another program controls
};

/// Asks a camera who controls it (GVCP, register "control channel privilege"), within 0.6 s: Aravis itself would wait
/// for seconds, both for one that is not there and for one that is taken.
/// \return nothing if that is no IPv4 address
std::optional<GigeAnswer> probe_gige(const std::string& address);

/// Why a camera at that address may be silent, and what to do; for other ids, what can be said of them.
std::string why_silent(const std::string& id);

}  // namespace pagesweep
