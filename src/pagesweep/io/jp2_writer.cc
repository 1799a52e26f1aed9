// SPDX-License-Identifier: Apache-2.0
#include <openjpeg.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <vector>

#include "pagesweep/io/jp2_writer_internal.h"

namespace pagesweep {
namespace {

using Codec = std::unique_ptr<opj_codec_t, decltype(&opj_destroy_codec)>;
using JpegImage = std::unique_ptr<opj_image_t, decltype(&opj_image_destroy)>;
using Stream = std::unique_ptr<opj_stream_t, decltype(&opj_stream_destroy)>;

/// A file in memory, as OpenJPEG wants to write one.
struct Output {
  std::string bytes;
  std::size_t at = 0;

  static OPJ_SIZE_T write(void* data, OPJ_SIZE_T count, void* user) {
    auto& output = *static_cast<Output*>(user);
    output.bytes.resize(std::max(output.bytes.size(), output.at + count));
    std::memcpy(output.bytes.data() + output.at, data, count);
    output.at += count;
    return count;
  }
  static OPJ_OFF_T skip(OPJ_OFF_T count, void* user) {
    auto& output = *static_cast<Output*>(user);
    output.at += static_cast<std::size_t>(count);
    output.bytes.resize(std::max(output.bytes.size(), output.at));
    return count;
  }
  static OPJ_BOOL seek(OPJ_OFF_T place, void* user) {
    auto& output = *static_cast<Output*>(user);
    output.at = static_cast<std::size_t>(place);
    output.bytes.resize(std::max(output.bytes.size(), output.at));
    return OPJ_TRUE;
  }
};

Stream make_stream(Output& output) {
  Stream stream(opj_stream_default_create(OPJ_FALSE), opj_stream_destroy);
  opj_stream_set_write_function(stream.get(), Output::write);
  opj_stream_set_skip_function(stream.get(), Output::skip);
  opj_stream_set_seek_function(stream.get(), Output::seek);
  opj_stream_set_user_data(stream.get(), &output, nullptr);
  return stream;
}

opj_cparameters_t archive_profile(const Picture& picture) {
  constexpr int most_decompositions = 5;
  opj_cparameters_t profile;
  opj_set_default_encoder_parameters(&profile);
  const auto smaller_side = static_cast<unsigned>(std::min(picture.width(), picture.height()));
  profile.numresolution = std::min<int>(most_decompositions, std::bit_width(smaller_side) - 1) + 1;
  profile.prog_order = OPJ_RPCL;
  profile.cblockw_init = profile.cblockh_init = 64;
  profile.csty = 0x01 | 0x02 | 0x04;  // own precincts, SOP, EPH
  profile.res_spec = profile.numresolution;
  for (int k = 0; k < profile.res_spec; ++k) profile.prcw_init[k] = profile.prch_init[k] = k < 2 ? 256 : 128;
  profile.tcp_numlayers = 1;
  profile.tcp_rates[0] = 0;  // without loss
  profile.cp_disto_alloc = 1;
  profile.tcp_mct = picture.channels == 3 ? 1 : 0;
  return profile;
}

JpegImage to_jpeg_image(const Picture& picture) {
  std::vector<opj_image_cmptparm_t> components(static_cast<std::size_t>(picture.channels));
  for (auto& component : components) {
    component = {};
    component.dx = component.dy = 1;
    component.w = static_cast<OPJ_UINT32>(picture.width());
    component.h = static_cast<OPJ_UINT32>(picture.height());
    component.prec = static_cast<OPJ_UINT32>(picture.bit_depth());
  }
  JpegImage image(opj_image_create(static_cast<OPJ_UINT32>(components.size()), components.data(),
                                   picture.channels == 1 ? OPJ_CLRSPC_GRAY : OPJ_CLRSPC_SRGB),
                  opj_image_destroy);
  if (!image) throw std::runtime_error("OpenJPEG finds no memory for the picture");
  image->x1 = static_cast<OPJ_UINT32>(picture.width());
  image->y1 = static_cast<OPJ_UINT32>(picture.height());
  std::visit(
      [&](const auto& samples) {
        const auto channels = static_cast<std::size_t>(picture.channels);
        for (std::size_t c = 0; c < channels; ++c)
          for (std::size_t i = 0; i < samples.size() / channels; ++i)
            image->comps[c].data[i] = samples.data()[i * channels + c];
      },
      picture.samples);
  return image;
}

void remember(const char* message, void* user) { *static_cast<std::string*>(user) = message; }

}  // namespace

std::string pack_jp2(const Picture& picture) {
  opj_cparameters_t profile = archive_profile(picture);
  const JpegImage image = to_jpeg_image(picture);
  const Codec codec(opj_create_compress(OPJ_CODEC_JP2), opj_destroy_codec);
  std::string message = "OpenJPEG cannot pack the picture";
  opj_set_error_handler(codec.get(), remember, &message);
  constexpr const char* tables[] = {"PLT=YES", "TLM=YES", nullptr};
  Output output;
  const Stream stream = make_stream(output);
  const bool done = opj_setup_encoder(codec.get(), &profile, image.get()) &&
                    opj_encoder_set_extra_options(codec.get(), tables) &&
                    opj_start_compress(codec.get(), image.get(), stream.get()) &&
                    opj_encode(codec.get(), stream.get()) && opj_end_compress(codec.get(), stream.get());
  if (!done) throw std::runtime_error(message);
  return std::move(output.bytes);
}

}  // namespace pagesweep
