// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace pagesweep::cli {

/// Ends a run from the inside, so that everything half-done is cleaned up on the way out.
struct Interrupted {
  int signal;
};

/// From now on SIGINT and SIGTERM only leave a note, which throw_if_interrupted() acts upon. A second one kills.
void catch_interrupts();

/// \throws Interrupted  if a signal has come
void throw_if_interrupted();

}  // namespace pagesweep::cli
