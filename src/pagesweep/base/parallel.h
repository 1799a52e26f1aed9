// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

namespace pagesweep {

/// Calls body(begin, end) for ranges that together cover [0, count), on all threads. Ranges are of
/// `grain` rows (the last one may be shorter) whatever the number of threads, so a result that is
/// gathered per range does not depend on it. An exception from `body` reaches the caller.
/// \throws std::invalid_argument  if grain < 1
void parallel_ranges(int count, int grain, const std::function<void(int begin, int end)>& body);

/// Calls body(y) for every y in [0, height), on all threads.
void parallel_rows(int height, const std::function<void(int y)>& body);

/// Limits all parallel work of this process to `threads` (0: all cores) while it lives.
class ThreadLimit {
 public:
  explicit ThreadLimit(int threads);
  ~ThreadLimit();
  ThreadLimit(const ThreadLimit&) = delete;
  ThreadLimit& operator=(const ThreadLimit&) = delete;

 private:
  void* control_ = nullptr;
};

}  // namespace pagesweep
