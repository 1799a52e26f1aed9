// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include "pagesweep/base/error.h"
#include "pagesweep/delivery/page_record_internal.h"
#include "pagesweep/io/json_file.h"
#include "pagesweep/io/json_reader.h"

namespace pagesweep {
namespace {

namespace fs = std::filesystem;

fs::path record_file(const fs::path& folder, const std::string& name) { return folder / "records" / (name + ".json"); }

}  // namespace

void write_record(const fs::path& folder, const PageRecord& record) {
  nlohmann::ordered_json files = nlohmann::ordered_json::array();
  for (const DeliveredFile& file : record.page.files)
    files.push_back({{"group", file.group}, {"path", file.path}, {"size", file.size_bytes}, {"sha256", file.sha256}});
  write_json(record_file(folder, record.page.name), {{"format", "pagesweep-page-record"},
                                                     {"version", 1},
                                                     {"source_sha256", record.source_sha256},
                                                     {"settings", record.settings},
                                                     {"label", record.page.label},
                                                     {"files", std::move(files)}});
}

std::optional<PageRecord> read_record(const fs::path& folder, const std::string& name) {
  if (!fs::exists(record_file(folder, name))) return std::nullopt;
  try {
    const JsonReader root = JsonReader::read(record_file(folder, name));
    root.expect_format("pagesweep-page-record", 1);
    PageRecord record{root.at("source_sha256").text(), root.at("settings").text(), {name, root.at("label").text(), {}}};
    for (const JsonReader& file : root.at("files").items()) {
      record.page.files.push_back({file.at("group").text(), file.at("path").text(),
                                   static_cast<std::uint64_t>(file.at("size").number(0, 1e15)),
                                   file.at("sha256").text()});
      const DeliveredFile& last = record.page.files.back();
      std::error_code failure;
      if (fs::file_size(folder / last.path, failure) != last.size_bytes) return std::nullopt;
    }
    return record;
  } catch (const Error&) {  // a record serves to save time: a broken one does not
    return std::nullopt;
  }
}

void remove_records(const fs::path& folder) {
  std::error_code ignored;
  fs::remove_all(folder / "records", ignored);
}

}  // namespace pagesweep
