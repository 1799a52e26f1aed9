// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <cstring>
#include <vector>

#include "pagesweep/base/parallel.h"
#include "pagesweep/data/frames.h"

namespace pagesweep::bench {

/// Keeps the compiler from leaving out what nobody looks at.
inline std::atomic<std::uint64_t> sink = 0;

/// Calls body(bytes) for each frame that is there, on all threads.
template <class Body>
void for_each_frame(const std::vector<Frames>& cameras, const Body& body) {
  for (const Frames& camera : cameras)
    parallel_rows(camera.count(), [&](int i) {
      if (camera.has(i)) std::visit([&](const auto& image) { body(std::as_bytes(image.pixels())); }, camera.frame(i));
    });
}

/// Sum of all bytes, eight at a time: what it costs to look at the frames at all.
inline void read_plainly(const std::vector<Frames>& cameras) {
  for_each_frame(cameras, [](std::span<const std::byte> bytes) {
    std::uint64_t sum = 0;
    for (std::size_t k = 0; k + 8 <= bytes.size(); k += 8) {
      std::uint64_t word = 0;
      std::memcpy(&word, bytes.data() + k, 8);
      sum += word;
    }
    sink += sum;
  });
}

/// Copies each frame to a place that every thread uses again and again.
inline void copy_plainly(const std::vector<Frames>& cameras) {
  for_each_frame(cameras, [](std::span<const std::byte> bytes) {
    thread_local std::vector<std::byte> copy;
    copy.resize(bytes.size());
    std::memcpy(copy.data(), bytes.data(), bytes.size());
    sink += static_cast<std::uint64_t>(copy.back());
  });
}

}  // namespace pagesweep::bench
