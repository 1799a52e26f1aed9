// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/base/parallel.h"

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <stdexcept>

#ifdef __SANITIZE_THREAD__
#include <sanitizer/tsan_interface.h>
#endif

namespace pagesweep {
namespace {

/// What happened before leave() in one thread has happened after enter() in another. TBB sees to that, but it is not
/// built with the thread sanitizer, which has to be told.
class Order {
 public:
#ifdef __SANITIZE_THREAD__
  void leave() { __tsan_release(this); }
  void enter() { __tsan_acquire(this); }
#else
  void leave() {}
  void enter() {}
#endif
};

}  // namespace

void parallel_ranges(int count, int grain, const std::function<void(int, int)>& body) {
  if (grain < 1) throw std::invalid_argument("parallel_ranges: grain must be at least 1");
  const int ranges = (std::max(count, 0) + grain - 1) / grain;
  Order begin, end;
  begin.leave();
  tbb::parallel_for(tbb::blocked_range<int>(0, ranges, 1), [&](const tbb::blocked_range<int>& block) {
    begin.enter();
    for (int i = block.begin(); i < block.end(); ++i) body(i * grain, std::min(count, (i + 1) * grain));
    end.leave();
  });
  end.enter();
}

void parallel_rows(int height, const std::function<void(int)>& body) {
  parallel_ranges(height, 1, [&](int y, int) { body(y); });
}

ThreadLimit::ThreadLimit(int threads) {
  if (threads > 0)
    control_ = new tbb::global_control(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
}

ThreadLimit::~ThreadLimit() { delete static_cast<tbb::global_control*>(control_); }

}  // namespace pagesweep
