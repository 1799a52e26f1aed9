// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <charconv>
#include <pugixml.hpp>

#include "pagesweep/base/error.h"
#include "pagesweep/delivery/checksum.h"
#include "pagesweep/delivery/mets.h"
#include "pagesweep/io/atomic_file.h"

namespace pagesweep {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t most_bytes = std::size_t{1} << 30;

/// The path that a relative URI (RFC 3986) means.
std::string path_of(std::string_view uri) {
  std::string path;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    unsigned code = 0;
    const char* digits = uri.data() + i + 1;
    const bool is_coded =
        uri[i] == '%' && i + 2 < uri.size() && std::from_chars(digits, digits + 2, code, 16).ptr == digits + 2;
    path += is_coded ? static_cast<char>(code) : uri[i];
    i += is_coded ? 2 : 0;
  }
  return path;
}

bool leads_out(const fs::path& path) {
  if (path.empty() || path.is_absolute()) return true;
  for (const fs::path& part : path)
    if (part == "..") return true;
  return false;
}

DeliveredFile read_entry(const pugi::xml_node& entry, const fs::path& file) {
  const DeliveredFile listed{entry.attribute("ID").value(),
                             path_of(entry.child("FLocat").attribute("xlink:href").value()),
                             entry.attribute("SIZE").as_ullong(), entry.attribute("CHECKSUM").value()};
  if (std::string_view(entry.attribute("CHECKSUMTYPE").value()) != "SHA-256")
    throw bad_input(file, listed.group, "expected a CHECKSUM of the type SHA-256");
  if (leads_out(listed.path)) throw bad_input(file, listed.group, "expected a file in this folder or below it");
  return listed;
}

}  // namespace

MetsListing read_mets(const fs::path& file) {
  const std::string text = read_bytes(file, most_bytes);
  pugi::xml_document document;
  const auto result = document.load_buffer(text.data(), text.size());
  if (!result) throw bad_input(file, fmt::format("byte {}", result.offset), result.description());
  const pugi::xml_node root = document.child("mets");
  if (!root) throw bad_input(file, "", "expected METS, found another root element");
  MetsListing listing{root.attribute("LABEL").value(), 0, {}};
  for (const pugi::xml_node& group : root.child("fileSec").children("fileGrp"))
    for (const pugi::xml_node& entry : group.children("file")) listing.files.push_back(read_entry(entry, file));
  for (const pugi::xml_node& page : root.child("structMap").child("div").children("div"))
    listing.pages += std::string_view(page.attribute("TYPE").value()) == "page";
  return listing;
}

void check_files(const fs::path& folder, const MetsListing& listing) {
  for (const DeliveredFile& listed : listing.files) {
    const fs::path file = folder / listed.path;
    if (!fs::is_regular_file(file)) throw cannot_read(file, "mets.xml lists it, but it is not there");
    if (fs::file_size(file) != listed.size_bytes || sha256_of(file) != listed.sha256)
      throw bad_input(file, "", "it is not what was delivered: size or checksum differ from mets.xml");
  }
}

}  // namespace pagesweep
