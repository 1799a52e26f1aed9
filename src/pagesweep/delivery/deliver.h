// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "pagesweep/base/progress.h"
#include "pagesweep/delivery/mets.h"
#include "pagesweep/delivery/page_source.h"
#include "pagesweep/delivery/pdf_document.h"
#include "pagesweep/io/image_file.h"

namespace pagesweep {

struct DeliveryOptions {
  std::string formats = "tiff,pdf";
  std::string page_name = "page_{page:04}";
  int first_page = 1;
  std::string ocr = "";
  std::string title = "";
  PdfImagePacking pdf_image = PdfImagePacking::jpeg;
  PictureFileOptions picture{};

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("formats", formats, "",
          "what to make of each page, with commas: tiff, png, jpeg, jp2, pdf (one for the job)");
    visit("page-name", page_name, "",
          "names of the pages' files: text with {page} or {page:04}, {index}, {side} (left, right, single), {capture}");
    visit("first-page", first_page, "", "number of the first page");
    visit("ocr", ocr, "", "recognise text in this language, such as eng or eng+deu: hOCR, ALTO, text in the PDF");
    visit("title", title, "", "of the job; empty: the name of its folder");
    visit("pdf-image", pdf_image, "", "how pictures are packed in the PDF: jpeg with loss, jp2 without");
    picture.describe(visit);
  }
};

/// What made a delivery, for its metadata.
struct DeliveryOrigin {
  std::string program;  ///< "pagesweep 0.1.0"
  std::string date;     ///< ISO 8601; empty: not told
};

struct Delivery {
  std::vector<DeliveredPage> pages;
  std::vector<DeliveredFile> of_the_job;  ///< the PDF
  int reused = 0;                         ///< pages that an earlier run, which was broken off, had finished
};

/// Makes of flat pages what a digitisation workshop hands over (docs/deliverables.md): the pages' pictures in a folder
/// a format, with --ocr hOCR and ALTO, a PDF/A-2b of the whole job, and last mets.xml, which completes the folder.
/// Pages are worked on side by side, some at a time, so that memory does not grow with their number.
///
/// Each file appears whole or not at all. A run that is broken off leaves the pages that are finished, with a record
/// each in `records/`; the next one with the same options goes on from there.
/// \throws Error                  if a page cannot be read, a file not be written, or text not be recognised
/// \throws std::invalid_argument  if an option makes no sense, or two pages would have the same name
Delivery deliver(std::span<const PageSource> sources, const std::filesystem::path& folder,
                 const DeliveryOptions& options, const DeliveryOrigin& origin, Progress& progress = no_progress());

}  // namespace pagesweep
