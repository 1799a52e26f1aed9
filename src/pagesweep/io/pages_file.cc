// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/pages_file.h"

#include <nlohmann/json.hpp>

#include "pagesweep/io/json_file.h"
#include "pagesweep/io/json_reader.h"

namespace pagesweep {

void write_pages_file(const std::filesystem::path& folder, const PagesFile& file) {
  nlohmann::ordered_json pages = nlohmann::ordered_json::array();
  for (const PageEntry& page : file.pages)
    pages.push_back({{"index", page.index}, {"picture", page.picture}, {"side", page.side}});
  write_json(folder / "pages.json",
             {{"format", "pagesweep-pages"}, {"version", 1}, {"capture", file.capture}, {"pages", std::move(pages)}});
}

std::optional<PagesFile> read_pages_file(const std::filesystem::path& folder) {
  if (!std::filesystem::exists(folder / "pages.json")) return std::nullopt;
  const JsonReader root = JsonReader::read(folder / "pages.json");
  root.expect_format("pagesweep-pages", 1);
  PagesFile file{root.at("capture").text(), {}};
  for (const JsonReader& page : root.at("pages").items()) {
    file.pages.push_back({page.at("index").integer(1, 1'000'000), page.at("picture").text(), page.at("side").text()});
    const std::string& name = file.pages.back().picture;
    if (name.empty() || std::filesystem::path(name).filename() != name)
      throw page.at("picture").error("expected the name of a file in this folder, found '" + name + "'");
  }
  return file;
}

}  // namespace pagesweep
