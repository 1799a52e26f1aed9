// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace pagesweep::cli {

/// From now on memory that is no longer needed goes back to the system at once: by itself glibc would come to keep maps
/// of 4 MB among small things, where a hole of 100 MB or more stays.
void return_unused_memory();

/// While it lives such memory is kept, for pages to be made of points: they need less than the frames did before, and
/// to get the same memory again and again takes an eighth of their time.
class UnusedMemoryKept {
 public:
  UnusedMemoryKept();
  ~UnusedMemoryKept();
  UnusedMemoryKept(const UnusedMemoryKept&) = delete;
  UnusedMemoryKept& operator=(const UnusedMemoryKept&) = delete;
};

}  // namespace pagesweep::cli
