// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <exception>

#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/io/capture_file.h"
#include "pagesweep/io/image_file.h"

namespace pagesweep {
namespace {

/// Instants that are decoded together: enough work for all threads, little enough memory to be nobody's worry.
constexpr int instants_ahead = 8;

int depth_of(const GrayImage& image) { return image.index() == 0 ? 8 : 16; }

int highest_gray_value(const GrayImage& image) {
  return std::visit([](const auto& pixels) { return int{*std::ranges::max_element(pixels.pixels())}; }, image);
}

/// Checks a frame against what capture.json says about its gray values.
void require_depth(const GrayImage& image, int bit_depth, const std::filesystem::path& file) {
  const int expected = bit_depth <= 8 ? 8 : 16;
  if (depth_of(image) != expected)
    throw bad_input(file, "",
                    fmt::format("expected {} bit samples for the bit_depth {} in capture.json, found {} bit", expected,
                                bit_depth, depth_of(image)));
  const int limit = 1 << bit_depth;
  if (bit_depth == expected) return;
  if (const int highest = highest_gray_value(image); highest >= limit)
    throw bad_input(file, "",
                    fmt::format("expected gray values below {} for the bit_depth {} in capture.json, found {}: correct "
                                "bit_depth, or move the camera's bits down",
                                limit, bit_depth, highest));
}

/// Frames of a folder whose files are numbered.
class FolderSource : public FrameSource {
 public:
  FolderSource(const Capture& capture, const Rig& rig) : capture_(capture) {
    for (const SequenceFiles& files : capture_.sequences) {
      const Camera* camera = rig.find_camera(files.camera);
      if (!camera)
        throw bad_input(capture_.folder / "capture.json", "sequences",
                        fmt::format("camera \"{}\" is not in the rig {}", files.camera, capture_.rig_path().string()));
      sequences_.push_back(make_sequence(files, *camera));
      count_ = std::max(count_, files.count);
      require_any_frame(files);
    }
  }

  const std::vector<Sequence>& sequences() const override { return sequences_; }

  std::optional<FrameSet> next() override {
    if (ahead_.empty()) read_ahead();
    if (ahead_.empty()) return std::nullopt;
    FrameSet set = std::move(ahead_.front());
    ahead_.pop_front();
    return set;
  }

 private:
  void require_any_frame(const SequenceFiles& files) const {
    for (int i = 0; i < files.count; ++i)
      if (std::filesystem::exists(capture_.frame_path(files, i))) return;
    throw cannot_read(capture_.frame_path(files, 0),
                      fmt::format("none of the {} frames of camera \"{}\" exists: check \"frames\" and \"first\" in {}",
                                  files.count, files.camera, (capture_.folder / "capture.json").string()));
  }

  void read_ahead() {
    const int cameras = static_cast<int>(sequences_.size());
    const int instants = std::min(instants_ahead, count_ - done_);
    std::vector<FrameSet> sets(static_cast<std::size_t>(instants));
    for (int i = 0; i < instants; ++i)
      sets[static_cast<std::size_t>(i)] = {done_ + i, std::vector<std::optional<GrayImage>>(sequences_.size())};
    // Every file is tried and the first error of all is thrown, so that the message does not depend on the threads.
    std::vector<std::exception_ptr> errors(static_cast<std::size_t>(instants * cameras));
    parallel_ranges(instants * cameras, 1, [&](int k, int) {
      try {
        auto& set = sets[static_cast<std::size_t>(k / cameras)];
        const auto camera = static_cast<std::size_t>(k % cameras);
        set.images[camera] = read_frame(camera, set.index);
      } catch (...) {
        errors[static_cast<std::size_t>(k)] = std::current_exception();
      }
    });
    for (const auto& error : errors)
      if (error) std::rethrow_exception(error);
    done_ += instants;
    std::ranges::move(sets, std::back_inserter(ahead_));
  }

  std::optional<GrayImage> read_frame(std::size_t camera, int i) const {
    const Sequence& sequence = sequences_[camera];
    const auto file = capture_.frame_path(capture_.sequences[camera], i);
    if (i >= sequence.count || !std::filesystem::exists(file)) return std::nullopt;
    GrayImage image = read_gray(file, ImageSize{sequence.width, sequence.height});
    require_depth(image, sequence.bit_depth, file);
    return image;
  }

  Capture capture_;
  std::vector<Sequence> sequences_;
  int count_ = 0;
  int done_ = 0;
  std::deque<FrameSet> ahead_;
};

}  // namespace

Sequence make_sequence(const SequenceFiles& files, const Camera& camera) {
  return {files.camera,    camera.width,      camera.height,    files.count,
          files.bit_depth, files.black_level, files.saturation, relative_exposures(files.exposure_ms, files.count)};
}

std::unique_ptr<FrameSource> open_capture(const Capture& capture, const Rig& rig) {
  return std::make_unique<FolderSource>(capture, rig);
}

}  // namespace pagesweep
