// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/camera/rig.h"

#include <algorithm>

namespace pagesweep {

const Camera* Rig::find_camera(std::string_view name) const {
  const auto found = std::find_if(cameras.begin(), cameras.end(), [&](const Camera& c) { return c.name == name; });
  return found == cameras.end() ? nullptr : &*found;
}

}  // namespace pagesweep
