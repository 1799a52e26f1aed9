// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "pagesweep/delivery/mets.h"

namespace pagesweep {

/// What a finished page was made from and how: if that is still the same, it need not be made again.
struct PageRecord {
  std::string source_sha256;
  std::string settings;  ///< everything else that the files depend on
  DeliveredPage page;
};

/// \param folder  of the job
void write_record(const std::filesystem::path& folder, const PageRecord& record);

/// \return  nothing if there is none, it cannot be read, or a file of it is missing or has another size
std::optional<PageRecord> read_record(const std::filesystem::path& folder, const std::string& name);

void remove_records(const std::filesystem::path& folder);

}  // namespace pagesweep
