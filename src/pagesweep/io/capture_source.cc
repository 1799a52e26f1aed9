// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <stop_token>
#include <thread>

#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/io/capture_file.h"
#include "pagesweep/io/frame_instants_internal.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/recording_file.h"

namespace pagesweep {
namespace {

/// Instants that are read together: enough work for all threads. As many again may wait to be fetched, which is little
/// enough memory to be nobody's worry.
constexpr int instants_together = 4;

int depth_of(const GrayImage& image) { return image.index() == 0 ? 8 : 16; }

int highest_gray_value(const GrayImage& image) {
  const auto highest_of = [](const auto& pixels) {
    auto highest = *pixels.data();
    for (const auto gray : pixels.pixels()) highest = std::max(highest, gray);  // unlike max_element(), in vectors
    return int{highest};
  };
  return std::visit(highest_of, image);
}

/// Checks a frame against what capture.json says about its gray values.
/// \param place  of the frame in the file: "page 7"; empty: it is all there is
void require_depth(const GrayImage& image, int bit_depth, const std::filesystem::path& file, const std::string& place) {
  const int expected = bit_depth <= 8 ? 8 : 16;
  if (depth_of(image) != expected)
    throw bad_input(file, place,
                    fmt::format("expected {} bit samples for the bit_depth {} in capture.json, found {} bit", expected,
                                bit_depth, depth_of(image)));
  const int limit = 1 << bit_depth;
  if (bit_depth == expected) return;
  if (const int highest = highest_gray_value(image); highest >= limit)
    throw bad_input(file, place,
                    fmt::format("expected gray values below {} for the bit_depth {} in capture.json, found {}: correct "
                                "bit_depth, or move the camera's bits down",
                                limit, bit_depth, highest));
}

/// The frames of one camera, wherever they are.
class CameraFrames {
 public:
  virtual ~CameraFrames() = default;
  /// Frame i; nothing if it was dropped. May be called from several threads at a time.
  /// \throws Error  if it cannot be used
  virtual std::optional<GrayImage> read(int i) const = 0;
};

/// A file a frame.
class NumberedFiles : public CameraFrames {
 public:
  NumberedFiles(const Capture& capture, const SequenceFiles& files, ImageSize size)
      : capture_(capture), files_(files), size_(size) {
    for (int i = 0; i < files.count; ++i)
      if (std::filesystem::exists(capture.frame_path(files, i))) return;
    throw cannot_read(capture.frame_path(files, 0),
                      fmt::format("none of the {} frames of camera \"{}\" exists: check \"frames\" and \"first\" in {}",
                                  files.count, files.camera, (capture.folder / "capture.json").string()));
  }

  std::optional<GrayImage> read(int i) const override {
    const auto file = capture_.frame_path(files_, i);
    if (!std::filesystem::exists(file)) return std::nullopt;
    GrayImage image = read_gray(file, size_);
    require_depth(image, files_.bit_depth, file, "");
    return image;
  }

 private:
  Capture capture_;
  SequenceFiles files_;
  ImageSize size_;
};

/// A page a frame; dropped frames have none.
class RecordedPages : public CameraFrames {
 public:
  RecordedPages(const Capture& capture, const SequenceFiles& files, ImageSize size)
      : file_(capture.folder / files.recording), bit_depth_(files.bit_depth), recording_(file_, size) {
    const int recorded = files.count - static_cast<int>(files.dropped.size());
    if (recording_.pages() != recorded)
      throw bad_input(file_, "",
                      fmt::format("expected {} pages for \"count\" {} and {} \"dropped\" in capture.json, found {}",
                                  recorded, files.count, files.dropped.size(), recording_.pages()));
    auto next_dropped = files.dropped.begin();
    for (int i = 0, page = 0; i < files.count; ++i) {
      const bool is_dropped = next_dropped != files.dropped.end() && *next_dropped == i;
      if (is_dropped) ++next_dropped;
      pages_.push_back(is_dropped ? -1 : page++);
    }
  }

  std::optional<GrayImage> read(int i) const override {
    const int page = pages_[static_cast<std::size_t>(i)];
    if (page < 0) return std::nullopt;
    GrayImage image = recording_.read(page);
    require_depth(image, bit_depth_, file_, fmt::format("page {}", page));
    return image;
  }

 private:
  std::filesystem::path file_;
  int bit_depth_;
  RecordingReader recording_;
  std::vector<int> pages_;  ///< of each frame; -1: dropped
};

std::unique_ptr<const CameraFrames> open_frames(const Capture& capture, const SequenceFiles& files, ImageSize size) {
  if (files.recording.empty()) return std::make_unique<NumberedFiles>(capture, files, size);
  return std::make_unique<RecordedPages>(capture, files, size);
}

/// Frames from files, read ahead by a thread of its own.
class CaptureSource : public FrameSource {
 public:
  CaptureSource(const Capture& capture, const Rig& rig) {
    instants_ = instants_of(capture);
    for (const SequenceFiles& files : capture.sequences) {
      const Camera* camera = rig.find_camera(files.camera);
      if (!camera)
        throw bad_input(capture.folder / "capture.json", "sequences",
                        fmt::format("camera \"{}\" is not in the rig {}", files.camera, capture.rig_path().string()));
      sequences_.push_back(on_instants(make_sequence(files, *camera), instants_));
      cameras_.push_back(open_frames(capture, files, {camera->width, camera->height}));
    }
    // What live cameras do not tell of, a recording does not either: step by step both are used alike.
    std::erase_if(instants_, [](const Instant& instant) { return instant.number < 0; });
    reader_ = std::jthread([this](const std::stop_token& stop) { read_ahead(stop); });
  }

  const std::vector<Sequence>& sequences() const override { return sequences_; }

  std::optional<FrameSet> next() override {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return !ahead_.empty() || is_done_; });
    if (ahead_.empty() && failure_) std::rethrow_exception(failure_);
    if (ahead_.empty()) return std::nullopt;
    FrameSet set = std::move(ahead_.front());
    ahead_.pop_front();
    changed_.notify_all();
    return set;
  }

 private:
  int count() const { return static_cast<int>(instants_.size()); }

  /// Runs in the reader's thread until all frames are read, one cannot be, or the source goes.
  void read_ahead(const std::stop_token& stop) {
    std::exception_ptr failure;
    try {
      for (int begin = 0; begin < count() && !failure; begin += instants_together) {
        std::unique_lock lock(mutex_);
        if (!changed_.wait(lock, stop, [&] { return ahead_.size() <= instants_together; })) return;
        lock.unlock();
        std::vector<FrameSet> sets;
        failure = read_instants(begin, std::min(count(), begin + instants_together), stop, sets);
        lock.lock();
        std::ranges::move(sets, std::back_inserter(ahead_));
        changed_.notify_all();
      }
    } catch (...) {  // memory ran out
      failure = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    failure_ = failure;
    is_done_ = true;
    changed_.notify_all();
  }

  /// Every file is tried and the first error of all counts, so that the message does not depend on the threads.
  /// \param sets  all instants before the error
  std::exception_ptr read_instants(int begin, int end, const std::stop_token& stop, std::vector<FrameSet>& sets) const {
    const int cameras = static_cast<int>(cameras_.size());
    for (int i = begin; i < end; ++i) {
      const Instant& instant = instants_[static_cast<std::size_t>(i)];
      sets.push_back({instant.index, std::vector<std::optional<GrayImage>>(cameras_.size()), instant.late});
    }
    std::vector<std::exception_ptr> errors(sets.size() * cameras_.size());
    parallel_ranges(static_cast<int>(errors.size()), 1, [&](int k, int) {
      if (stop.stop_requested()) return;
      try {
        const auto camera = static_cast<std::size_t>(k % cameras);
        const int i = begin + k / cameras;
        const int number = instants_[static_cast<std::size_t>(i)].number;
        sets[static_cast<std::size_t>(k / cameras)].images[camera] = cameras_[camera]->read(number);
      } catch (...) {
        errors[static_cast<std::size_t>(k)] = std::current_exception();
      }
    });
    const auto first = std::ranges::find_if(errors, [](const auto& error) { return error != nullptr; });
    if (first == errors.end()) return nullptr;
    sets.resize(static_cast<std::size_t>(first - errors.begin()) / cameras_.size());
    return *first;
  }

  std::vector<Sequence> sequences_;
  std::vector<std::unique_ptr<const CameraFrames>> cameras_;
  std::vector<Instant> instants_;

  std::mutex mutex_;  ///< guards what follows
  std::condition_variable_any changed_;
  std::deque<FrameSet> ahead_;
  bool is_done_ = false;        ///< nothing more will come
  std::exception_ptr failure_;  ///< why, if a frame could not be read

  std::jthread reader_;  ///< last: it ends before what it uses goes
};

}  // namespace

Sequence make_sequence(const SequenceFiles& files, const Camera& camera) {
  return {files.camera,    camera.width,      camera.height,    files.count,
          files.bit_depth, files.black_level, files.saturation, relative_exposures(files.exposure_ms, files.count)};
}

Rig read_camera_sizes(const Capture& capture) {
  Rig rig;
  for (const SequenceFiles& files : capture.sequences) {
    Camera camera;
    camera.name = files.camera;
    if (!files.recording.empty()) {
      const ImageSize size = RecordingReader(capture.folder / files.recording).size();
      camera.width = size.width, camera.height = size.height;
    } else {
      int i = 0;
      while (i + 1 < files.count && !std::filesystem::exists(capture.frame_path(files, i))) ++i;
      const GrayImage first = read_gray(capture.frame_path(files, i));
      camera.width = width_of(first), camera.height = height_of(first);
    }
    rig.cameras.push_back(std::move(camera));
  }
  return rig;
}

std::unique_ptr<FrameSource> open_capture(const Capture& capture, const Rig& rig) {
  return std::make_unique<CaptureSource>(capture, rig);
}

}  // namespace pagesweep
