// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace pagesweep {

/// A file that was delivered.
struct DeliveredFile {
  std::string group;  ///< what it is: "tiff", "jp2", "alto", "pdf", ...
  std::string path;   ///< from the job's folder
  std::uint64_t size_bytes = 0;
  std::string sha256;  ///< 64 hexadecimal digits
};

/// One page and the files that show it.
struct DeliveredPage {
  std::string name;   ///< of its files, without extension
  std::string label;  ///< what people call it: its number
  std::vector<DeliveredFile> files;
};

struct MetsHeader {
  std::string id, title;
  std::string program;   ///< "pagesweep 0.1.0"
  std::string date;      ///< ISO 8601; empty: not told
  std::string language;  ///< of the text, as Tesseract names it; empty: not known
};

/// The whole job as METS 1.12: a file section with a group a kind of file, sizes and checksums; the pages in order as
/// the physical structure, to which files of the whole job (a PDF) belong as well.
std::string format_mets(const MetsHeader& header, const std::vector<DeliveredPage>& pages,
                        const std::vector<DeliveredFile>& of_the_job);

/// What a METS file lists.
struct MetsListing {
  std::string title;
  std::size_t pages = 0;
  std::vector<DeliveredFile> files;  ///< their `group` is the file's ID there
};

/// Reads a file that format_mets() wrote.
/// \throws Error  if it cannot be read, is no METS, or lists a file without SHA-256 or outside of its folder
MetsListing read_mets(const std::filesystem::path& file);

/// Reads every file of a listing and compares size and checksum.
/// \throws Error  that names the first that is missing or another than the listing says
void check_files(const std::filesystem::path& folder, const MetsListing& listing);

}  // namespace pagesweep
