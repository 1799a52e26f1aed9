// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/delivery/mets.h"

#include <fmt/format.h>

#include <cctype>
#include <map>
#include <stdexcept>
#include <string_view>

#include "pagesweep/delivery/xml_document_internal.h"

namespace pagesweep {
namespace {

struct Kind {
  const char* group;
  const char* mime_type;
  const char* use;
};
constexpr Kind kinds[] = {{"tiff", "image/tiff", "MASTER"},      {"jp2", "image/jp2", "ARCHIVE"},
                          {"png", "image/png", "LOSSLESS"},      {"jpeg", "image/jpeg", "DEFAULT"},
                          {"hocr", "text/vnd.hocr+html", "OCR"}, {"alto", "application/xml", "FULLTEXT"},
                          {"pdf", "application/pdf", "DOWNLOAD"}};

const Kind& kind_of(const std::string& group) {
  for (const Kind& kind : kinds)
    if (group == kind.group) return kind;
  throw std::invalid_argument("format_mets: unknown kind of file: " + group);
}

/// The groups of the file section; made when their first file comes.
class FileSection {
 public:
  explicit FileSection(pugi::xml_node mets) : section_(add_element(mets, "fileSec")) {}

  void add(const DeliveredFile& file, const std::string& id) {
    const Kind& kind = kind_of(file.group);
    pugi::xml_node& group = groups_[file.group];
    if (!group) group = add_element(section_, "fileGrp", {{"ID", "group_" + file.group}, {"USE", kind.use}});
    add_element(add_element(group, "file",
                            {{"ID", id},
                             {"MIMETYPE", kind.mime_type},
                             {"SIZE", std::to_string(file.size_bytes)},
                             {"CHECKSUM", file.sha256},
                             {"CHECKSUMTYPE", "SHA-256"}}),
                "FLocat", {{"LOCTYPE", "URL"}, {"xlink:href", uri_of(file.path)}});
  }

 private:
  /// A relative path as a URI (RFC 3986).
  static std::string uri_of(const std::string& path) {
    std::string uri;
    for (const char c : path) {
      const bool is_plain =
          std::isalnum(static_cast<unsigned char>(c)) || std::string_view("/-._~").find(c) != std::string_view::npos;
      uri += is_plain ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
    }
    return uri;
  }

  pugi::xml_node section_;
  std::map<std::string, pugi::xml_node> groups_;
};

void add_header(pugi::xml_node mets, const MetsHeader& header) {
  const pugi::xml_node element = add_element(mets, "metsHdr", {{"CREATEDATE", header.date}});
  add_text(add_element(element, "agent", {{"ROLE", "CREATOR"}, {"TYPE", "OTHER"}, {"OTHERTYPE", "SOFTWARE"}}), "name",
           header.program);
  const pugi::xml_node wrap = add_element(add_element(mets, "dmdSec", {{"ID", "description_1"}}), "mdWrap",
                                          {{"MIMETYPE", "text/xml"}, {"MDTYPE", "DC"}});
  const pugi::xml_node data = add_element(wrap, "xmlData");
  add_text(data, "dc:title", header.title);
  std::istringstream languages(header.language);
  for (std::string language; std::getline(languages, language, '+');) add_text(data, "dc:language", language);
}

}  // namespace

std::string format_mets(const MetsHeader& header, const std::vector<DeliveredPage>& pages,
                        const std::vector<DeliveredFile>& of_the_job) {
  pugi::xml_document document = new_document();
  const pugi::xml_node mets =
      add_element(document, "mets",
                  {{"xmlns", "http://www.loc.gov/METS/"},
                   {"xmlns:xlink", "http://www.w3.org/1999/xlink"},
                   {"xmlns:dc", "http://purl.org/dc/elements/1.1/"},
                   {"xmlns:xsi", "http://www.w3.org/2001/XMLSchema-instance"},
                   {"xsi:schemaLocation", "http://www.loc.gov/METS/ http://www.loc.gov/standards/mets/mets.xsd"},
                   {"OBJID", header.id},
                   {"LABEL", header.title}});
  add_header(mets, header);
  FileSection files(mets);
  const pugi::xml_node sequence =
      add_element(add_element(mets, "structMap", {{"TYPE", "PHYSICAL"}}), "div",
                  {{"ID", "sequence"}, {"TYPE", "physSequence"}, {"LABEL", header.title}, {"DMDID", "description_1"}});
  for (const DeliveredFile& file : of_the_job) {
    files.add(file, "job_" + file.group);
    add_element(sequence, "fptr", {{"FILEID", "job_" + file.group}});
  }
  int order = 0;
  for (const DeliveredPage& page : pages) {
    const std::string number = std::to_string(++order);
    const pugi::xml_node division = add_element(sequence, "div",
                                                {{"ID", "page_" + number},
                                                 {"TYPE", "page"},
                                                 {"ORDER", number},
                                                 {"ORDERLABEL", page.label},
                                                 {"LABEL", page.name}});
    for (const DeliveredFile& file : page.files) {
      const std::string id = fmt::format("page_{}_{}", number, file.group);
      files.add(file, id);
      add_element(division, "fptr", {{"FILEID", id}});
    }
  }
  return to_text(document);
}

}  // namespace pagesweep
