// SPDX-License-Identifier: Apache-2.0
#include "cli/scan_live.h"

#include <fmt/format.h>

#include <chrono>
#include <exception>
#include <functional>
#include <optional>

#include "cli/console_progress.h"
#include "cli/live_recording.h"
#include "cli/live_view.h"
#include "cli/memory.h"
#include "cli/output_folder.h"
#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/io/rig_file.h"

namespace pagesweep::cli {
namespace {

/// Steps are told when the sweep is over: before that, LiveView has the screen.
class QuietSweep : public Progress {
 public:
  explicit QuietSweep(Progress& progress) : progress_(progress) {}
  void end_sweep() { is_over_ = true; }

  void begin(std::string_view step) override {
    if (is_over_) progress_.begin(step);
  }
  void advance(double share) override {
    if (is_over_) progress_.advance(share);
  }
  void warn(std::string_view message) override { progress_.warn(message); }

 private:
  Progress& progress_;
  bool is_over_ = false;
};

/// Tells why a sweep ended, if it ended early, as soon as it has.
class WatchedSource : public FrameSource {
 public:
  WatchedSource(FrameSource& source, const LiveSource& live, LiveView& view, QuietSweep& progress)
      : source_(source), live_(live), view_(view), progress_(progress) {}
  const std::vector<Sequence>& sequences() const override { return source_.sequences(); }
  std::optional<FrameSet> next() override {
    auto set = source_.next();
    has_begun_ |= set.has_value();
    if (set) return set;
    view_.clear();
    if (!live_.ended_early().empty()) progress_.warn("partial: " + live_.ended_early());
    progress_.end_sweep();
    return set;
  }
  bool has_begun() const { return has_begun_; }
  double seconds_since_last_frame() const {
    return std::chrono::duration<double>(Clock::now() - live_.last_arrival()).count();
  }

 private:
  FrameSource& source_;
  const LiveSource& live_;
  LiveView& view_;
  QuietSweep& progress_;
  bool has_begun_ = false;
};

/// When what was there [s] after the last frame had come from the network.
struct Readiness {
  std::optional<double> without_scan, scan;  ///< nothing if the points do not need the scan
  double points = 0;
};

/// Points, with what the scan tells of the print, if it comes. If there are none, the recording is kept all the same.
Measurement measure(WatchedSource& source, LatePicture& late_picture, const Rig& rig, const ScanOptions& options,
                    QuietSweep& progress, Readiness& ready, const std::function<void()>& keep_recording) {
  std::optional<Picture> none;  // of the scan's size: whatever is looked up in it tells nothing
  const ScanSource scan = [&]() -> const Picture& {
    if (!ready.without_scan) ready.without_scan = source.seconds_since_last_frame();
    const Picture* picture = late_picture.get();
    if (!ready.scan) ready.scan = source.seconds_since_last_frame();
    if (picture) return *picture;
    if (!none) none = make_picture(rig.scanner->width(), rig.scanner->height(), 1, 8);
    return *none;
  };
  try {
    Measurement measurement = reconstruct(source, rig, options, progress, scan);
    ready.points = source.seconds_since_last_frame();
    return measurement;
  } catch (const Error&) {
    if (source.has_begun()) keep_recording();
    throw;
  }
}

/// Pages, if some are found. What was measured stays either way: the sweep cannot be done again.
/// \return why there are none
std::exception_ptr flatten(Scan& scan, const Picture& picture, const Rig& rig, const ScanOptions& options,
                           Progress& progress) {
  try {
    const UnusedMemoryKept kept;
    scan = pagesweep::flatten(std::move(scan.measurement), picture, rig, options, progress);
    return nullptr;
  } catch (const Error&) {
    return std::current_exception();
  }
}

void tell(const Readiness& ready) {
  if (ready.without_scan)
    fmt::print(
        stderr,
        "after the last frame: {:.2f} s to the points without the scan's help, {:.2f} s to the scan, {:.2f} s to "
        "the finished points\n",
        *ready.without_scan, *ready.scan, ready.points);
  else
    fmt::print(stderr, "after the last frame: {:.2f} s to the finished points\n", ready.points);
}

std::vector<Figure> figures_of(const Readiness& ready, const LiveStatus& status) {
  std::vector<Figure> figures;
  if (ready.without_scan) {
    figures.push_back({"live", "points_without_scan_after",
                       "from the last frame to the points without the scan's help, which have no normals yet",
                       *ready.without_scan, "s", ""});
    figures.push_back({"live", "scan_after", "from the last frame to the scanner's picture", *ready.scan, "s", ""});
  }
  figures.push_back({"live", "points_after", "from the last frame to the finished points", ready.points, "s", ""});
  for (const auto& camera : status.cameras) {
    const auto add = [&](const char* name, const char* what, std::int64_t count) {
      figures.push_back({camera.name, name, what, static_cast<double>(count), "frames", ""});
    };
    add("frames_received", "frames that came whole", camera.counts.received);
    add("frames_damaged", "frames that lost packets on their way and were not used", camera.counts.damaged);
    add("frames_lost", "frames of which nothing came, by the camera's own count", camera.counts.lost);
    add("frames_unpaired", "whole frames whose trigger no other camera saw; used all the same", camera.counts.unpaired);
    add("frames_late", "whole frames that came after their turn and were not used", camera.counts.late);
  }
  return figures;
}

/// Why something is less than it should be; empty: it is not.
struct Problems {
  std::string sweep, picture, recording;
  std::string of_result() const { return join_problems(sweep, picture); }
};

void warn(const Problems& problems, const LiveView& view, const LiveStatus& status, ConsoleProgress& console) {
  if (!problems.picture.empty()) console.warn("partial: " + problems.picture);
  if (!problems.recording.empty()) console.warn("the recording is partial: " + problems.recording);
  for (const std::string& remark : view.remarks()) console.warn(remark);
  for (const auto& camera : status.cameras) {
    const FrameCounts& counts = camera.counts;
    if (counts.damaged + counts.lost + counts.unpaired + counts.late > 0) console.warn(describe(camera));
  }
}

/// Fails if something was missing, now that all is written.
void end(const Problems& problems, const std::exception_ptr& no_pages, const LiveScan& arguments) {
  if (!problems.of_result().empty())
    throw pagesweep::cannot_read(arguments.output, "the result is partial: " + problems.of_result());
  if (no_pages) std::rethrow_exception(no_pages);
  if (!problems.recording.empty())
    throw pagesweep::cannot_write(arguments.record, "the recording is partial: " + problems.recording);
}

void check(const LiveScan& arguments, const Rig& rig) {
  if (arguments.input.scanner.empty() && arguments.picture.empty())
    throw CLI::ValidationError("--scanner",
                               "live cameras need it, or --picture, for there would be nothing to flatten");
  if (!rig.scanner)
    throw pagesweep::bad_input(arguments.rig, "scanner", "it is missing, and without it no picture can be flattened");
}

}  // namespace

void scan_live(const LiveScan& arguments) {
  if (arguments.rig.empty()) throw CLI::ValidationError("--rig", "live cameras need it");
  const Rig rig = read_rig(arguments.rig);
  check(arguments, rig);
  const ThreadLimit limit(arguments.common.threads);
  ConsoleProgress console(arguments.common.quiet);
  QuietSweep progress(console);
  OutputFolder output(arguments.output, "report.json");
  std::optional<LiveRecording> recording;
  if (!arguments.record.empty()) recording.emplace(arguments.record);
  LiveView view(arguments.common.quiet);
  OpenedRig opened = open(arguments.input, rig, view);
  const LiveSource& live = *opened.source;
  WatchedSource source(recording ? recording->begin(opened, false) : *opened.source, live, view, progress);
  LatePicture late_picture(opened.scanner.get(), arguments.picture);
  ScanOptions options = arguments.options;
  options.on_points = [&view](const PointMap& points) { view.show(points); };

  const auto record = [&] {
    if (recording)
      recording->finish(rig, late_picture.get(), join_problems(live.ended_early(), late_picture.problem()));
  };

  Readiness ready;
  Scan scan;
  scan.measurement = measure(source, late_picture, rig, options, progress, ready, record);
  const LiveStatus status = live.status();
  view.finish(status);
  if (!arguments.common.quiet) tell(ready);
  const Picture* picture = late_picture.get();
  record();
  const Problems problems{live.ended_early(), late_picture.problem(), recording ? recording->trouble() : ""};
  const std::exception_ptr no_pages = picture ? flatten(scan, *picture, rig, options, progress) : nullptr;
  warn(problems, view, status, console);
  write_scan(output,
             {.title = arguments.output.filename().string(),
              .sequences = live.sequences(),
              .scan = scan,
              .picture = picture,
              .options = options,
              .files = arguments.files,
              .fail_on = arguments.quality.fail_on,
              .figures = figures_of(ready, status)},
             console, arguments.common);
  end(problems, no_pages, arguments);
}

}  // namespace pagesweep::cli
