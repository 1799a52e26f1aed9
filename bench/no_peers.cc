// SPDX-License-Identifier: Apache-2.0
#include "bench/peers.h"

namespace pagesweep::bench {

bool has_peers() { return false; }
void limit_peer_threads(int) {}
std::int64_t decode_gray_code(const StereoFrames&) { return 0; }
std::int64_t match_blocks(const StereoFrames&, int, double, double) { return 0; }

}  // namespace pagesweep::bench
