// SPDX-License-Identifier: Apache-2.0
// Reading captures whose files the system has in memory, against one read() of the same files' bytes.
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include "bench/comparison.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/io/capture_file.h"

namespace pagesweep::bench {
namespace {

/// The files that hold a capture's frames.
std::vector<std::filesystem::path> files_of(const Capture& capture) {
  std::vector<std::filesystem::path> files;
  for (const SequenceFiles& sequence : capture.sequences) {
    if (!sequence.recording.empty()) files.push_back(capture.folder / sequence.recording);
    if (sequence.recording.empty())
      for (int i = 0; i < sequence.count; ++i)
        if (const auto file = capture.frame_path(sequence, i); std::filesystem::exists(file)) files.push_back(file);
  }
  return files;
}

/// Reads all bytes, a megabyte at a time into the same place.
void read_files(const std::vector<std::filesystem::path>& files) {
  std::vector<char> buffer(1 << 20);
  for (const auto& file : files) {
    const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
    while (::read(descriptor, buffer.data(), buffer.size()) > 0) continue;
    ::close(descriptor);
  }
}

void read_capture_frames(const Capture& capture, const Rig& rig) {
  const auto source = open_capture(capture, rig);
  while (source->next()) continue;
}

}  // namespace

void measure_reading(const Settings& settings, Report& report) {
  report.title("Reading captures whose files are in the system's memory");
  if (settings.captures_to_read.empty()) report.note("left out: no captures are given (--read)");
  std::vector<Way> ways;
  for (const auto& folder : settings.captures_to_read) {
    const Capture capture = read_capture(folder);
    const Rig rig = read_capture_rig(capture);
    ways.push_back({[files = files_of(capture)] { read_files(files); }});
    ways.push_back({[=] { read_capture_frames(capture, rig); }});
    ways.push_back({[=] { read_all(*open_capture(capture, rig)); }});
  }
  const auto seconds = interleave(settings.rounds, ways);
  for (std::size_t k = 0; k < settings.captures_to_read.size(); ++k) {
    const std::string name = settings.captures_to_read[k].filename().string();
    report.add({name + ": read() of its files", "s", seconds[3 * k]});
    report.add({name + ": its frames, one after the other", "s", seconds[3 * k + 1]});
    report.add({name + ": the same over read()", "", ratios(seconds[3 * k + 1], seconds[3 * k])});
    report.add({name + ": its frames, all kept", "s", seconds[3 * k + 2]});
  }
}

}  // namespace pagesweep::bench
