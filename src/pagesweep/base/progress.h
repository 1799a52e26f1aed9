// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace pagesweep {

/// How the library tells its host what it is doing; it never prints. Derive to show a bar, to log,
/// or to stop a run: an exception thrown from a callback ends the run and reaches the caller.
class Progress {
 public:
  virtual ~Progress() = default;
  /// A station begins: "time values of cam1", ...
  virtual void begin(std::string_view /*step*/) {}
  /// Share of the current step that is done, 0 to 1.
  virtual void advance(double /*share*/) {}
  /// Something the user should know although the run goes on: dropped frames, a page without an edge, ...
  virtual void warn(std::string_view /*message*/) {}
};

/// For callers that want none.
Progress& no_progress();

}  // namespace pagesweep
