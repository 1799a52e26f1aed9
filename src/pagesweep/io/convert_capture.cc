// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/convert_capture.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <fstream>
#include <memory>
#include <random>

#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/file_descriptor_internal.h"
#include "pagesweep/io/frame_instants_internal.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/recording_file.h"

namespace pagesweep {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t instants_together = 8;  ///< packed by all threads before the next ones are fetched

/// Stores the frames of one camera.
class SequenceWriter {
 public:
  virtual ~SequenceWriter() = default;
  /// The next instants, of which this camera's frames are stored.
  virtual void append(const std::vector<FrameSet>& sets, std::size_t camera) = 0;
  /// To be called after the last instant.
  /// \param files  learns where the frames are
  virtual void finish(SequenceFiles& files) = 0;
};

class RecordingOfSequence : public SequenceWriter {
 public:
  RecordingOfSequence(const fs::path& folder, const Sequence& sequence)
      : name_(sequence.camera + "/frames.tiff"),
        writer_(folder / name_, {sequence.width, sequence.height}, sequence.bit_depth <= 8 ? 8 : 16, sequence.count) {}

  void append(const std::vector<FrameSet>& sets, std::size_t camera) override {
    for (const FrameSet& set : sets) {
      if (!set.images[camera]) continue;
      leave_out(set.index);
      writer_.append(*set.images[camera]);
      ++next_;
    }
  }
  void finish(SequenceFiles& files) override {
    leave_out(files.count);
    writer_.commit();
    files.recording = name_;
    files.dropped = dropped_;
  }

 private:
  /// All frames before this one that have not come.
  void leave_out(int end) {
    for (; next_ < end; ++next_) dropped_.push_back(next_);
  }

  std::string name_;
  RecordingWriter writer_;
  int next_ = 0;
  std::vector<int> dropped_;
};

class FilesOfSequence : public SequenceWriter {
 public:
  FilesOfSequence(const fs::path& folder, const Sequence& sequence, FrameFormat format) : format_(format) {
    copy_.folder = folder;
    files_.frames = fmt::format("{}/%06d.{}", sequence.camera, format == FrameFormat::png ? "png" : "tiff");
  }

  void append(const std::vector<FrameSet>& sets, std::size_t camera) override {
    parallel_rows(static_cast<int>(sets.size()), [&](int k) {
      const FrameSet& set = sets[static_cast<std::size_t>(k)];
      const auto& image = set.images[camera];
      if (!image) return;
      const fs::path file = copy_.frame_path(files_, set.index);
      if (format_ == FrameFormat::png)
        write_gray_png(file, *image);
      else
        write_gray_tiff(file, *image);
    });
  }
  void finish(SequenceFiles& files) override { files.frames = files_.frames; }

 private:
  FrameFormat format_;
  Capture copy_;
  SequenceFiles files_;
};

/// Leaves out frames, and gives those that are left the numbers that they will have in the copy.
class Selection {
 public:
  Selection(const Capture& capture, const ConvertOptions& options)
      : instants_(instants_of(capture)), options_(options), random_(static_cast<std::uint64_t>(options.seed)) {}

  /// \return whether something of the set is left
  bool select(FrameSet& set) {
    int& number = set.index;
    number = instants_[static_cast<std::size_t>(number)].number;
    const bool is_lost = chance(options_.lose);
    for (auto& image : set.images)
      if (chance(options_.drop)) image.reset();
    if (number < 0 || is_lost) return false;
    kept_.push_back(number);
    if (options_.lose > 0) number = static_cast<int>(kept_.size()) - 1;
    return true;
  }

  /// What becomes of a sequence when triggers are lost: those that are left, and their times.
  void renumber(SequenceFiles& files, double interval_ns) const {
    if (!(options_.lose > 0)) return;
    const SequenceFiles all = files;
    files.timestamps_ns.clear();
    if (all.exposure_ms.size() > 1) files.exposure_ms.clear();
    for (const int number : kept_) {
      const auto i = static_cast<std::size_t>(number);
      files.timestamps_ns.push_back(all.timestamps_ns.empty() ? std::llround(number * interval_ns)
                                                              : all.timestamps_ns[i]);
      if (all.exposure_ms.size() > 1) files.exposure_ms.push_back(all.exposure_ms[i % all.exposure_ms.size()]);
    }
    files.count = static_cast<int>(kept_.size());
  }

 private:
  bool chance(double share) { return static_cast<double>(random_() >> 11) * 0x1p-53 < share; }

  std::vector<Instant> instants_;
  const ConvertOptions& options_;
  std::mt19937_64 random_;
  std::vector<int> kept_;
};

void copy_frames(FrameSource& source, Selection& selection, const ConvertOptions& options, Capture& copy,
                 Progress& progress) {
  std::vector<std::unique_ptr<SequenceWriter>> writers;
  for (const Sequence& sequence : source.sequences()) {
    if (options.format == FrameFormat::recording)
      writers.push_back(std::make_unique<RecordingOfSequence>(copy.folder, sequence));
    else
      writers.push_back(std::make_unique<FilesOfSequence>(copy.folder, sequence, options.format));
  }
  progress.begin("copying the frames");
  const double count = source.sequences().empty() ? 1 : source.sequences().front().count;
  std::vector<FrameSet> sets;
  const auto store = [&] {
    parallel_rows(static_cast<int>(writers.size()),
                  [&](int c) { writers[static_cast<std::size_t>(c)]->append(sets, static_cast<std::size_t>(c)); });
    sets.clear();
  };
  while (auto set = source.next()) {
    const int done = set->index + 1;
    if (selection.select(*set)) sets.push_back(std::move(*set));
    if (sets.size() < instants_together) continue;
    store();
    progress.advance(done / count);
  }
  store();
  for (std::size_t c = 0; c < writers.size(); ++c) {
    SequenceFiles& files = copy.sequences[c];
    selection.renumber(files, copy.frame_interval_ns);
    files.frames.clear(), files.first = 0, files.recording.clear(), files.dropped.clear();
    writers[c]->finish(files);
  }
}

void copy_whole(const fs::path& from, const fs::path& to) {
  if (!fs::is_regular_file(from)) throw cannot_read(from, "there is no such file");
  if (!std::ifstream(from)) throw cannot_read(from, message_of(errno));
  AtomicFile output(to);
  std::error_code failure;
  fs::copy_file(from, output.temporary(), fs::copy_options::overwrite_existing, failure);
  if (failure) throw cannot_write(to, failure.message());
  output.commit();
}

void copy_folder(const fs::path& from, const fs::path& to) {
  for (const auto& entry : fs::recursive_directory_iterator(from))
    if (entry.is_regular_file()) copy_whole(entry.path(), to / fs::relative(entry.path(), from));
}

/// A capture cannot be made again, so that no file of one is ever replaced; and a frame that is already there would
/// stand in for a dropped one.
void require_empty(const fs::path& folder) {
  if (fs::exists(folder) && !(fs::is_directory(folder) && fs::is_empty(folder)))
    throw cannot_write(folder, "it is there already, and a capture is never overwritten: name a new folder");
}

}  // namespace

Capture convert_capture(const Capture& capture, FrameSource& frames, const fs::path& folder,
                        const ConvertOptions& options, Progress& progress) {
  require_empty(folder);
  Capture copy = capture;
  copy.folder = folder;
  constexpr double usual_interval_ns = 10e6;
  if (options.lose > 0 && copy.frame_interval_ns == 0 && copy.sequences[0].timestamps_ns.empty())
    copy.frame_interval_ns = usual_interval_ns;
  Selection selection(capture, options);
  copy_frames(frames, selection, options, copy, progress);
  progress.begin("copying the rest");
  copy.rig = "rig.json";
  copy_whole(capture.rig_path(), copy.rig_path());
  if (capture.scan) {
    copy.scan = fs::path("scan").replace_extension(capture.scan->extension());
    copy_whole(*capture.scan_path(), *copy.scan_path());
  }
  if (fs::is_directory(capture.folder / "truth")) copy_folder(capture.folder / "truth", folder / "truth");
  write_capture(copy);
  return copy;
}

}  // namespace pagesweep
