// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/base/progress.h"

namespace pagesweep {

Progress& no_progress() {
  static Progress silent;
  return silent;
}

}  // namespace pagesweep
