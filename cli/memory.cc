// SPDX-License-Identifier: Apache-2.0
#include "cli/memory.h"

#include <malloc.h>

namespace pagesweep::cli {

void return_unused_memory() {
  mallopt(M_MMAP_THRESHOLD, 1 << 20);
  malloc_trim(0);
}

UnusedMemoryKept::UnusedMemoryKept() {
  mallopt(M_MMAP_THRESHOLD, 1 << 25);  // glibc takes no more
  mallopt(M_TRIM_THRESHOLD, 1 << 29);
}

UnusedMemoryKept::~UnusedMemoryKept() { return_unused_memory(); }

}  // namespace pagesweep::cli
