// SPDX-License-Identifier: Apache-2.0
// Dewarps a page with Leptonica and says where each pixel came from. scripts/comparison compiles and runs it.
// Usage: leptonica_dewarp PAGE.png FLAT.png ORIGIN.bin
//
// ORIGIN.bin has for each pixel of FLAT.png, row by row, two unsigned 16-bit numbers in the machine's order: row + 1,
// column
// + 1 in PAGE.png, or 0, 0 if it came from nowhere. They are found by dewarping a picture whose pixels say where they
// are.
#include <leptonica/allheaders.h>

#include <cstdint>
#include <cstdio>

namespace {

/// A picture whose pixel (x, y) is x + 1 in its upper and y + 1 in its lower half.
PIX* make_coordinates(int width, int height) {
  PIX* pix = pixCreate(width, height, 32);
  l_uint32* data = pixGetData(pix);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      data[y * pixGetWpl(pix) + x] = static_cast<l_uint32>(x + 1) << 16 | static_cast<l_uint32>(y + 1);
  return pix;
}

/// Models the page as Leptonica's documentation does: text lines for the curves, their ends for the stretch along them.
L_DEWARPA* build_model(PIX* gray) {
  PIX* even = pixBackgroundNormSimple(gray, nullptr, nullptr);
  PIX* binary = pixThresholdToBinary(even, 130);
  L_DEWARPA* models = dewarpaCreate(1, 30, 1, 10, 50);
  dewarpaUseBothArrays(models, 1);
  L_DEWARP* model = dewarpCreate(binary, 0);
  dewarpaInsertDewarp(models, model);
  dewarpBuildPageModel(model, nullptr);
  std::printf("lines %d, vertical model %d, horizontal model %d\n", model->nlines, model->vsuccess, model->hsuccess);
  pixDestroy(&even);
  pixDestroy(&binary);
  return models;
}

PIX* apply(L_DEWARPA* models, PIX* source, int gray_in) {
  PIX* flat = nullptr;
  dewarpaApplyDisparity(models, 0, source, gray_in, 0, 0, &flat, nullptr);
  return flat;
}

int write_origin(PIX* origin, const char* file) {
  std::FILE* stream = std::fopen(file, "wb");
  if (!stream) return 1;
  for (int y = 0; y < pixGetHeight(origin); ++y)
    std::fwrite(pixGetData(origin) + y * pixGetWpl(origin), 4, static_cast<std::size_t>(pixGetWidth(origin)), stream);
  return std::fclose(stream);
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 4) return std::fprintf(stderr, "usage: leptonica_dewarp PAGE.png FLAT.png ORIGIN.bin\n"), 2;
  PIX* page = pixRead(arguments[1]);
  if (!page) return 4;
  PIX* gray = pixConvertTo8(page, 0);
  PIX* coordinates = make_coordinates(pixGetWidth(gray), pixGetHeight(gray));
  L_DEWARPA* models = build_model(gray);
  PIX* flat = apply(models, gray, 255);
  PIX* origin = apply(models, coordinates, 0);
  if (!flat || !origin) return 6;
  return pixWrite(arguments[2], flat, IFF_PNG) || write_origin(origin, arguments[3]) ? 5 : 0;
}
