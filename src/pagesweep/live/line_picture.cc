// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <thread>

#include "pagesweep/base/error.h"
#include "pagesweep/live/pair_frames.h"
#include "pagesweep/live/scan_picture.h"

namespace pagesweep {
namespace {

class LinePicture : public ScanPictureSource {
 public:
  LinePicture(std::unique_ptr<GenicamCamera> camera, int height)
      : camera_(std::move(camera)),
        picture_(make_picture(camera_->width(), height, camera_->channels(), camera_->bit_depth() <= 8 ? 8 : 16)),
        blocks_((height + camera_->height() - 1) / camera_->height()),
        has_come_(static_cast<std::size_t>(blocks_), false) {
    camera_->start();
    thread_ = std::jthread([this](const std::stop_token& stop) {
      while (!stop.stop_requested())
        camera_->receive(std::chrono::milliseconds(50), [this](const RawFrame& block) { take(block); });
    });
  }
  ~LinePicture() override {
    thread_.request_stop();
    thread_.join();
    camera_->stop();
  }

  Picture finish(std::chrono::milliseconds longest) override {
    std::unique_lock lock(mutex_);
    const auto is_done = [this] { return counter_.total() >= blocks_; };
    for (std::int64_t before = -1; !is_done() && counter_.total() != before;) {
      before = counter_.total();
      changed_.wait_for(lock, longest, [&] { return is_done() || counter_.total() != before; });
    }
    const auto missing = std::ranges::count(has_come_, false);
    if (missing > 0)
      throw Error(ErrorKind::cannot_read,
                  fmt::format("{}: {} of {} blocks of {} rows of the scan have not come whole: see that its trigger "
                              "starts with the head's movement and that its network is not too slow",
                              camera_->name(), missing, blocks_, camera_->height()));
    return std::move(picture_);
  }

 private:
  void take(const RawFrame& block) {
    const std::lock_guard lock(mutex_);
    const std::int64_t number = counter_.count(block.id);
    if (block.is_whole && number >= 0 && number < blocks_) {
      std::visit([&](auto& samples) { copy(block, static_cast<int>(number), samples); }, picture_.samples);
      has_come_[static_cast<std::size_t>(number)] = true;
    }
    changed_.notify_all();
  }

  template <class T>
  void copy(const RawFrame& block, int number, Image<T>& samples) {
    const std::size_t row_bytes = static_cast<std::size_t>(samples.width()) * sizeof(T);
    const int first = number * block.height, end = std::min(first + block.height, samples.height());
    for (int y = first; y < end; ++y) {
      const int to = camera_->settings().is_reversed ? samples.height() - 1 - y : y;
      std::memcpy(samples.row(to).data(), block.bytes.data() + static_cast<std::size_t>(y - first) * row_bytes,
                  row_bytes);
    }
  }

  std::unique_ptr<GenicamCamera> camera_;
  std::mutex mutex_;  ///< guards what follows
  std::condition_variable changed_;
  FrameCounter counter_;
  Picture picture_;
  std::int64_t blocks_;
  std::vector<bool> has_come_;
  std::jthread thread_;  ///< last: it ends before what it uses goes
};

}  // namespace

std::unique_ptr<ScanPictureSource> take_lines(std::unique_ptr<GenicamCamera> camera, int height) {
  return std::make_unique<LinePicture>(std::move(camera), height);
}

}  // namespace pagesweep
