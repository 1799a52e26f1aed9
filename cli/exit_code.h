// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/error.h"

namespace pagesweep::cli {

/// What the program's exit status tells a script (docs/cli.md). A run that a signal ended exits with 128 + its number.
enum ExitCode {
  success = 0,
  internal_error = 1,  ///< a defect of the program, or memory ran out
  usage_error = 2,     ///< the command line says something that cannot be meant
  bad_input = 3,       ///< a file says something that cannot be used
  cannot_read = 4,     ///< a file is missing, unreadable or cut short
  cannot_write = 5,    ///< an output could not be written
  no_result = 6,       ///< the input is sound but nothing could be measured from it
  limit_exceeded = 7,  ///< a test was done and its answer is no: acceptance, or check
};

/// Ends a run whose answer is that a limit is not kept.
struct LimitExceeded {};

inline ExitCode exit_code_of(ErrorKind kind) {
  switch (kind) {
    case ErrorKind::bad_input:
      return bad_input;
    case ErrorKind::cannot_read:
      return cannot_read;
    case ErrorKind::cannot_write:
      return cannot_write;
    case ErrorKind::no_result:
      return no_result;
  }
  return internal_error;
}

}  // namespace pagesweep::cli
