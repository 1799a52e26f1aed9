// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

namespace pagesweep {

/// What kind of trouble the world gave us; the command line turns it into its exit code.
enum class ErrorKind {
  bad_input,     ///< a file or device says something that cannot be used
  cannot_read,   ///< a file is missing, unreadable or cut short
  cannot_write,  ///< an output could not be written
  no_result,     ///< the input is sound but nothing could be measured from it
};

/// The one exception type for errors of the outside world. A caller's mistake is std::invalid_argument
/// instead; a pixel that cannot be measured is a PixelStatus, not an exception.
///
/// The message is one sentence: file, place in it, what was expected or found, what to do.
class Error : public std::runtime_error {
 public:
  Error(ErrorKind kind, const std::string& message) : std::runtime_error(message), kind_(kind) {}
  ErrorKind kind() const { return kind_; }

 private:
  ErrorKind kind_;
};

/// "FILE: PLACE: PROBLEM". `place` (a JSON field, a line, a frame number) may be empty.
Error bad_input(const std::filesystem::path& file, const std::string& place, const std::string& problem);
Error cannot_read(const std::filesystem::path& file, const std::string& problem);
Error cannot_write(const std::filesystem::path& file, const std::string& problem);
Error no_result(const std::string& problem);

}  // namespace pagesweep
