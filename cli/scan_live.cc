// SPDX-License-Identifier: Apache-2.0
#include "cli/scan_live.h"

#include <fmt/format.h>

#include <chrono>
#include <optional>

#include "cli/console_progress.h"
#include "cli/live_view.h"
#include "cli/output_folder.h"
#include "cli/result_output.h"
#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/rig_file.h"
#include "pagesweep/live/record_capture.h"

namespace pagesweep::cli {
namespace {

constexpr auto longest_wait_for_picture = std::chrono::milliseconds(2000);

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

/// Tells when the last frame had come.
class TimedSource : public FrameSource {
 public:
  TimedSource(FrameSource& source, QuietSweep& progress) : source_(source), progress_(progress) {}
  const std::vector<Sequence>& sequences() const override { return source_.sequences(); }
  std::optional<FrameSet> next() override {
    auto set = source_.next();
    if (set) last_frame_ = Clock::now();
    if (!set) progress_.end_sweep();
    return set;
  }
  double seconds_since_last_frame() const { return std::chrono::duration<double>(Clock::now() - last_frame_).count(); }

 private:
  FrameSource& source_;
  QuietSweep& progress_;
  Clock::time_point last_frame_ = Clock::now();
};

/// The scanner's picture, when it is asked for.
class LatePicture {
 public:
  LatePicture(ScanPictureSource* scanner, const std::filesystem::path& file) : scanner_(scanner), file_(file) {}

  /// \return null if none comes, see problem()
  const Picture* get() {
    if (picture_ || !problem_.empty()) return picture_ ? &*picture_ : nullptr;
    try {
      picture_ = scanner_ ? scanner_->finish(longest_wait_for_picture) : read_picture(file_);
    } catch (const Error& error) {
      problem_ = error.what();
    }
    return picture_ ? &*picture_ : nullptr;
  }
  const std::string& problem() const { return problem_; }

 private:
  ScanPictureSource* scanner_;
  const std::filesystem::path& file_;
  std::optional<Picture> picture_;
  std::string problem_;
};

void finish_recording(const LiveScan& scan, CaptureRecorder& recorder, const OpenedRig& opened, const Rig& rig,
                      const Picture* picture) {
  Capture capture = describe_capture(scan.record, recorder.finish(), *opened.source);
  if (picture) {
    write_picture(scan.record / "scan.tif", *picture);
    capture.scan = "scan.tif";
  }
  const std::string& problem = opened.source->ended_early().empty() ? recorder.trouble() : opened.source->ended_early();
  if (!problem.empty()) capture.notes = "partial: " + problem;
  write_rig(scan.record / "rig.json", rig);
  write_devices(scan.record / "devices.json", opened.devices);
  write_capture(capture);
}

/// What makes the result a partial one; empty: nothing.
std::string problem_of(const LiveSource& live, const LatePicture& picture, const CaptureRecorder* recorder) {
  std::string problem = live.ended_early();
  for (const std::string& other : {picture.problem(), recorder ? recorder->trouble() : std::string()})
    if (!other.empty()) problem += (problem.empty() ? "" : "; ") + other;
  return problem;
}

void warn(const std::string& problem, const LiveView& view, const LiveSource& live, ConsoleProgress& console) {
  if (!problem.empty()) console.warn("partial: " + problem);
  for (const std::string& remark : view.remarks()) console.warn(remark);
  for (const auto& camera : live.status().cameras)
    if (camera.counts.damaged + camera.counts.lost + camera.counts.late > 0) console.warn(describe(camera));
}

void write_result(OutputFolder& output, const LiveScan& arguments, const LiveSource& live, const Scan& scan,
                  const Picture* picture, ConsoleProgress& console) {
  console.begin("writing the pages");
  output.begin();
  write_measurement(output.path(), scan.measurement);
  if (picture) write_pages(output.path(), scan.pages, scan.surfaces, arguments.files);
  RunResult result{.title = arguments.output.filename().string(),
                   .sequences = live.sequences(),
                   .measurement = scan.measurement,
                   .surfaces = scan.surfaces,
                   .pages = scan.pages,
                   .scan = picture};
  add_measuring_options(result.options, arguments.options);
  add_flattening_options(result.options, arguments.options);
  finish_result(output, result, console, arguments.common);
}

}  // namespace

void scan_live(const LiveScan& arguments) {
  if (arguments.rig.empty()) throw CLI::ValidationError("--rig", "live cameras need it");
  if (arguments.input.scanner.empty() && arguments.picture.empty())
    throw CLI::ValidationError("--scanner",
                               "live cameras need it, or --picture, for there would be nothing to flatten");
  const ThreadLimit limit(arguments.common.threads);
  ConsoleProgress console(arguments.common.quiet);
  QuietSweep progress(console);
  const Rig rig = read_rig(arguments.rig);
  OutputFolder output(arguments.output, "report.json");
  std::optional<OutputFolder> recording;
  if (!arguments.record.empty()) recording.emplace(arguments.record, "capture.json");
  LiveView view(arguments.common.quiet);
  OpenedRig opened = open(arguments.input, rig, view);
  LiveSource& live = *opened.source;
  std::optional<CaptureRecorder> recorder;
  std::optional<RecordedSource> recorded;
  if (recording) recorded.emplace(live, recorder.emplace(recording->path(), live.sequences()), false);
  FrameSource& frames = recorded ? static_cast<FrameSource&>(*recorded) : live;

  TimedSource source(frames, progress);
  LatePicture late_picture(opened.scanner.get(), arguments.picture);
  std::optional<double> points_after_s;
  std::optional<Picture> none;  // of the scan's size: whatever is looked up in it tells nothing
  const ScanSource picture_of = [&]() -> const Picture& {
    if (!points_after_s) points_after_s = source.seconds_since_last_frame();
    if (const Picture* picture = late_picture.get()) return *picture;
    if (!none) none = make_picture(rig.scanner->width(), rig.scanner->height(), 1, 8);
    return *none;
  };
  ScanOptions options = arguments.options;
  options.on_points = [&view](const PointMap& points) { view.show(points); };
  Scan scan;
  scan.measurement = reconstruct(source, rig, options, progress, rig.scanner ? picture_of : ScanSource());
  if (!points_after_s) points_after_s = source.seconds_since_last_frame();
  const Picture* picture = rig.scanner ? late_picture.get() : nullptr;
  if (picture) scan = flatten(std::move(scan.measurement), *picture, rig, options, progress);

  view.finish(live.status());
  const std::string problem = problem_of(live, late_picture, recorder ? &*recorder : nullptr);
  warn(problem, view, live, console);
  if (!arguments.common.quiet)
    fmt::print(stderr, "points were finished {:.2f} s after the last frame\n", *points_after_s);

  write_result(output, arguments, live, scan, picture, console);
  if (recorder) {
    finish_recording(arguments, *recorder, opened, rig, picture);
    recording->finish();
  }
  if (!problem.empty()) throw pagesweep::cannot_read(arguments.output, "the result is partial: " + problem);
}

}  // namespace pagesweep::cli
