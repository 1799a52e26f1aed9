// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/delivery/deliver.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/delivery/alto.h"
#include "pagesweep/delivery/checksum.h"
#include "pagesweep/delivery/page_record_internal.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/color_profile.h"
#include "pagesweep/io/image_codecs.h"
#include "pagesweep/io/page_metadata.h"
#include "pagesweep/io/page_name.h"
#include "pagesweep/ocr/hocr.h"
#include "pagesweep/ocr/recognise_text.h"

namespace pagesweep {
namespace {

namespace fs = std::filesystem;

constexpr int pages_at_a_time = 8;  // between two reports of progress; bounds the memory
constexpr std::size_t most_hocr_bytes = std::size_t{1} << 28;

struct ImageFormat {
  std::string_view name;
  std::string_view extension;
};
constexpr ImageFormat image_formats[] = {{"tiff", "tif"}, {"png", "png"}, {"jpeg", "jpg"}, {"jp2", "jp2"}};

/// What is asked for, checked.
struct Wanted {
  std::vector<ImageFormat> images;
  bool pdf = false;
};

Wanted read_formats(const std::string& list) {
  Wanted wanted;
  std::istringstream stream(list);
  for (std::string name; std::getline(stream, name, ',');) {
    const auto* format = std::ranges::find(image_formats, name, &ImageFormat::name);
    if (name == "pdf")
      wanted.pdf = true;
    else if (format == std::end(image_formats))
      throw std::invalid_argument(fmt::format("--formats: '{}' is none of tiff, png, jpeg, jp2, pdf", name));
    else
      wanted.images.push_back(*format);
  }
  if (wanted.images.empty() && !wanted.pdf) throw std::invalid_argument("--formats: nothing is asked for");
  return wanted;
}

/// Everything about a job that all of its pages share.
struct Job {
  Job(const fs::path& job_folder, const DeliveryOptions& job_options, const DeliveryOrigin& job_origin)
      : folder(job_folder), options(job_options), origin(job_origin), wanted(read_formats(job_options.formats)) {
    if (!options.ocr.empty()) read_text.emplace(options.ocr);
    name = fs::absolute(folder).lexically_normal().filename().string();
    if (name.empty()) name = fs::absolute(folder).lexically_normal().parent_path().filename().string();
    title = options.title.empty() ? name : options.title;
  }

  fs::path folder;
  DeliveryOptions options;
  DeliveryOrigin origin;
  Wanted wanted;
  std::optional<TextRecogniser> read_text;
  std::string name, title;
};

/// A page of the job, under its name.
struct NamedPage {
  PageSource source;
  std::string name, label;

  fs::path hocr() const { return fs::path("hocr") / (name + ".hocr"); }
};

std::vector<NamedPage> name_pages(std::span<const PageSource> sources, const DeliveryOptions& options) {
  std::vector<PageNaming> naming;
  for (const PageSource& source : sources)
    naming.push_back({options.first_page + static_cast<int>(naming.size()), source.index, source.side, source.capture});
  const std::vector<std::string> names = PageNamePattern(options.page_name).names(naming);
  std::vector<NamedPage> pages;
  for (std::size_t i = 0; i < sources.size(); ++i)
    pages.push_back({sources[i], names[i], std::to_string(naming[i].page)});
  return pages;
}

DeliveredFile describe(const Job& job, const std::string& group, const fs::path& path) {
  return {group, path.generic_string(), fs::file_size(job.folder / path), sha256_of(job.folder / path)};
}

/// What a page's files depend on beside its picture.
std::string settings_of(const Job& job, const NamedPage& page) {
  return fmt::format("{}; {}; {} {}; {}; {}; {} {}", job.origin.program, job.options.formats,
                     name_of(job.options.picture.tiff_compression), job.options.picture.jpeg_quality,
                     job.read_text ? job.read_text->language() + " " + job.read_text->version() : "", job.title,
                     page.label, page.source.capture);
}

void write_text(const Job& job, const NamedPage& page, const Picture& picture, std::vector<DeliveredFile>& files) {
  const TextPage text = (*job.read_text)(picture);
  const std::string image =
      files.empty() ? page.source.picture.filename().string() : fs::path(files.front().path).filename().string();
  write_bytes(job.folder / page.hocr(), format_hocr(text, {job.title, image, job.read_text->version()}));
  files.push_back(describe(job, "hocr", page.hocr()));
  const fs::path alto = fs::path("alto") / (page.name + ".xml");
  write_bytes(job.folder / alto,
              format_alto(text, {image, job.origin.program, job.read_text->version(), job.origin.date}));
  files.push_back(describe(job, "alto", alto));
}

DeliveredPage make_page(const Job& job, const NamedPage& page) {
  Picture picture = read_picture(page.source.picture);
  complete_profile(picture);
  complete_metadata(
      picture,
      {.title = job.title + ", page " + page.label, .source = page.source.capture, .program = job.origin.program});
  DeliveredPage delivered{page.name, page.label, {}};
  for (const ImageFormat& format : job.wanted.images) {
    const fs::path path = fs::path(format.name) / fmt::format("{}.{}", page.name, format.extension);
    write_picture(job.folder / path, format.name == "jpeg" ? with_8_bit(picture) : picture, job.options.picture);
    delivered.files.push_back(describe(job, std::string(format.name), path));
  }
  if (job.read_text) write_text(job, page, picture, delivered.files);
  return delivered;
}

/// The page as an earlier run left it, or made now.
DeliveredPage find_or_make(const Job& job, const NamedPage& page, bool& reused) {
  const std::string sum = sha256_of(page.source.picture), settings = settings_of(job, page);
  if (const auto record = read_record(job.folder, page.name))
    if (record->source_sha256 == sum && record->settings == settings) {
      reused = true;
      return record->page;
    }
  try {
    const PageRecord record{sum, settings, make_page(job, page)};
    write_record(job.folder, record);
    return record.page;
  } catch (const Error& error) {
    throw Error(error.kind(), fmt::format("page {} ({}): {}", page.label, page.source.picture.string(), error.what()));
  }
}

/// Calls work(i) for all pages, some side by side, and after(i) for these in order.
template <class Work, class After>
void in_batches(int count, Progress& progress, const Work& work, const After& after) {
  for (int begin = 0; begin < count; begin += pages_at_a_time) {
    const int end = std::min(count, begin + pages_at_a_time);
    parallel_rows(end - begin, [&](int k) { work(static_cast<std::size_t>(begin + k)); });
    for (int i = begin; i < end; ++i) after(static_cast<std::size_t>(i));
    progress.advance(static_cast<double>(end) / count);
  }
}

void write_pdf(const Job& job, const std::vector<NamedPage>& pages, const fs::path& path, Progress& progress) {
  AtomicFile output(job.folder / path);
  PdfDocument pdf(output.temporary(), {job.title, job.origin.program, job.origin.date, job.options.first_page});
  std::vector<std::optional<PdfImage>> images(pages.size());
  std::vector<std::optional<TextPage>> texts(pages.size());
  const auto prepare = [&](std::size_t i) {
    images[i] =
        make_pdf_image(read_picture(pages[i].source.picture), job.options.pdf_image, job.options.picture.jpeg_quality);
    const fs::path hocr = job.folder / pages[i].hocr();
    if (job.read_text) texts[i] = parse_hocr(read_bytes(hocr, most_hocr_bytes), hocr);
  };
  const auto add = [&](std::size_t i) {
    pdf.add(*images[i], texts[i] ? &*texts[i] : nullptr);
    images[i].reset();
    texts[i].reset();
  };
  in_batches(static_cast<int>(pages.size()), progress, prepare, add);
  pdf.finish();
  output.commit();
}

}  // namespace

Delivery deliver(std::span<const PageSource> sources, const fs::path& folder, const DeliveryOptions& options,
                 const DeliveryOrigin& origin, Progress& progress) {
  if (sources.empty()) throw std::invalid_argument("deliver: a job needs a page");
  const Job job(folder, options, origin);
  const std::vector<NamedPage> pages = name_pages(sources, options);
  const fs::path index = folder / "mets.xml";
  std::error_code failure;
  fs::remove(index, failure);
  if (failure) throw cannot_write(index, failure.message());

  progress.begin("pages");
  Delivery delivery;
  delivery.pages.resize(pages.size());
  std::vector<char> reused(pages.size(), 0);
  in_batches(
      static_cast<int>(pages.size()), progress,
      [&](std::size_t i) {
        bool was_there = false;
        delivery.pages[i] = find_or_make(job, pages[i], was_there);
        reused[i] = was_there;
      },
      [&](std::size_t i) { delivery.reused += reused[i]; });
  if (job.wanted.pdf) {
    progress.begin("the PDF");
    const fs::path path = job.name + ".pdf";
    write_pdf(job, pages, path, progress);
    delivery.of_the_job.push_back(describe(job, "pdf", path));
  }
  write_bytes(index, format_mets({job.name, job.title, origin.program, origin.date, options.ocr}, delivery.pages,
                                 delivery.of_the_job));
  remove_records(folder);
  return delivery;
}

}  // namespace pagesweep
