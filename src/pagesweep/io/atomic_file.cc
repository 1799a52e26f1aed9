// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/atomic_file.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <atomic>
#include <deque>
#include <span>

#include "pagesweep/base/error.h"
#include "pagesweep/io/file_descriptor_internal.h"

namespace pagesweep {
namespace {

/// A new, empty file beside the target. O_EXCL: never somebody else's file or link.
std::filesystem::path make_temporary(const std::filesystem::path& target) {
  static std::atomic<unsigned> serial{0};
  while (true) {
    const auto name =
        fmt::format(".{}.{}-{}{}", target.stem().string(), ::getpid(), serial++, target.extension().string());
    const auto path = target.parent_path() / name;
    const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor >= 0) {
      ::close(descriptor);
      return path;
    }
    if (errno != EEXIST) throw cannot_write(target, message_of(errno));
  }
}

void fill(const AtomicFile& output, std::string_view bytes) {
  FileDescriptor descriptor(output.temporary(), O_WRONLY);  // not O_TRUNC, after which ext4 waits for the disk
  if (descriptor.number() < 0) throw cannot_write(output.target(), message_of(errno));
  if (!descriptor.write(std::as_bytes(std::span(bytes)))) throw cannot_write(output.target(), message_of(errno));
  if (!descriptor.close()) throw cannot_write(output.target(), message_of(errno));
}

}  // namespace

AtomicFile::AtomicFile(std::filesystem::path target) : target_(std::move(target)) {
  if (!target_.has_filename()) throw cannot_write(target_, "it has no file name");
  std::error_code error;
  if (target_.has_parent_path() && !std::filesystem::is_directory(target_.parent_path(), error)) {
    std::filesystem::create_directories(target_.parent_path(), error);
    if (error) throw cannot_write(target_, "its folder cannot be made: " + error.message());
  }
  if (std::filesystem::is_directory(target_, error)) throw cannot_write(target_, "it is a folder");
  temporary_ = make_temporary(target_);
}

AtomicFile::~AtomicFile() {
  std::error_code ignored;
  if (!temporary_.empty()) std::filesystem::remove(temporary_, ignored);
}

void AtomicFile::commit() {
  std::error_code error;
  std::filesystem::rename(temporary_, target_, error);
  if (error) throw cannot_write(target_, error.message());
  temporary_.clear();
}

void write_bytes(const std::filesystem::path& file, std::string_view bytes) {
  AtomicFile output(file);
  fill(output, bytes);
  output.commit();
}

void write_together(const std::filesystem::path& folder, std::span<const NamedText> files) {
  std::deque<AtomicFile> outputs;
  for (const NamedText& file : files) fill(outputs.emplace_back(folder / file.name), file.text);
  for (AtomicFile& output : outputs) output.commit();
}

std::string read_bytes(const std::filesystem::path& file, std::size_t most_bytes) {
  FileDescriptor descriptor(file, O_RDONLY);
  if (descriptor.number() < 0) throw cannot_read(file, message_of(errno));
  struct stat status{};
  if (::fstat(descriptor.number(), &status) != 0) throw cannot_read(file, message_of(errno));
  if (S_ISDIR(status.st_mode)) throw cannot_read(file, "it is a folder");
  std::string bytes(status.st_size > 0 ? std::min(static_cast<std::size_t>(status.st_size), most_bytes) + 1 : 4096, 0);
  std::size_t filled = 0;
  while (true) {
    if (filled > most_bytes) throw bad_input(file, "", fmt::format("expected at most {} bytes", most_bytes));
    if (filled == bytes.size()) bytes.resize(2 * bytes.size());
    const ssize_t got = ::read(descriptor.number(), bytes.data() + filled, bytes.size() - filled);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw cannot_read(file, message_of(errno));
    if (got == 0) break;
    filled += static_cast<std::size_t>(got);
  }
  bytes.resize(filled);
  return bytes;
}

}  // namespace pagesweep
