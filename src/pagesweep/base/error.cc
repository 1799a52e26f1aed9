// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/base/error.h"

namespace pagesweep {

Error bad_input(const std::filesystem::path& file, const std::string& place, const std::string& problem) {
  return {ErrorKind::bad_input, file.string() + ": " + (place.empty() ? "" : place + ": ") + problem};
}

Error cannot_read(const std::filesystem::path& file, const std::string& problem) {
  return {ErrorKind::cannot_read, file.string() + ": cannot be read: " + problem};
}

Error cannot_write(const std::filesystem::path& file, const std::string& problem) {
  return {ErrorKind::cannot_write, file.string() + ": cannot be written: " + problem};
}

Error no_result(const std::string& problem) { return {ErrorKind::no_result, problem}; }

}  // namespace pagesweep
