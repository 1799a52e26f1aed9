// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arv.h>

#include <optional>

namespace pagesweep {

/// The largest packet [bytes] that the network interface to a camera carries; nothing if it cannot be found out.
std::optional<int> interface_mtu(ArvGvDevice* device);

}  // namespace pagesweep
