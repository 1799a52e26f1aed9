// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <array>
#include <map>
#include <optional>
#include <string>
#include <thread>

#include "pagesweep/base/error.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/live/scan_picture.h"

namespace pagesweep {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

constexpr auto between_looks = milliseconds(100);
constexpr int looks_without_growth = 4;

bool is_picture(const fs::path& file) {
  constexpr std::array<std::string_view, 7> suffixes{".tif", ".tiff", ".png", ".jpg", ".jpeg", ".jp2", ".TIF"};
  const std::string suffix = file.extension().string();
  return std::ranges::find(suffixes, suffix) != suffixes.end();
}

/// What a file is like at the moment.
struct Look {
  std::uintmax_t bytes = 0;
  fs::file_time_type written;
  bool operator==(const Look&) const = default;
};

std::map<fs::path, Look> look_at(const fs::path& folder) {
  std::map<fs::path, Look> files;
  std::error_code gone;  // a file may be renamed between two questions
  for (const auto& entry : fs::directory_iterator(folder, gone)) {
    if (!is_picture(entry.path()) || !entry.is_regular_file(gone)) continue;
    const Look look{entry.file_size(gone), entry.last_write_time(gone)};
    if (!gone) files[entry.path()] = look;
  }
  return files;
}

class FolderPicture : public ScanPictureSource {
 public:
  FolderPicture(fs::path folder, int width, int height) : folder_(std::move(folder)), width_(width), height_(height) {
    if (!fs::is_directory(folder_)) throw cannot_read(folder_, "it is no folder: name the one that the scanner fills");
    before_ = look_at(folder_);
  }

  Picture finish(milliseconds longest) override {
    std::map<fs::path, Look> last;
    std::map<fs::path, int> quiet;
    std::string problem = "no new picture has come";
    for (auto waited = milliseconds(0); waited < longest; waited += between_looks) {
      for (const auto& [file, look] : look_at(folder_)) {
        if (const auto old = before_.find(file); old != before_.end() && old->second == look) continue;
        quiet[file] = last.contains(file) && last[file] == look ? quiet[file] + 1 : 0;
        if (last[file] != look) waited = milliseconds(0);  // it grows
        last[file] = look;
        if (look.bytes == 0 || quiet[file] < looks_without_growth) continue;
        if (auto picture = read_whole(file, problem)) return *std::move(picture);
      }
      std::this_thread::sleep_for(between_looks);
    }
    throw cannot_read(folder_, problem + ": see that the scanner's software saves its pictures there");
  }

 private:
  /// Nothing while the file is not whole.
  std::optional<Picture> read_whole(const fs::path& file, std::string& problem) const {
    std::optional<Picture> picture;
    try {
      picture = read_picture(file);
    } catch (const Error& error) {
      problem = error.what();
      return std::nullopt;
    }
    if (picture->width() != width_ || picture->height() != height_)
      throw bad_input(file, "",
                      fmt::format("expected {} x {} pixels as the rig's scanner has, found {} x {}", width_, height_,
                                  picture->width(), picture->height()));
    return picture;
  }

  fs::path folder_;
  int width_, height_;
  std::map<fs::path, Look> before_;
};

}  // namespace

std::unique_ptr<ScanPictureSource> watch_folder(const fs::path& folder, int width, int height) {
  return std::make_unique<FolderPicture>(folder, width, height);
}

}  // namespace pagesweep
