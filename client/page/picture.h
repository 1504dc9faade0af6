// A small RGB picture: text, and PNG files.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "server/base/error.h"

namespace sightline {

using Rgb = std::array<uint8_t, 3>;

// Row-major from the top row.
struct Picture {
  int width = 0, height = 0;
  std::vector<Rgb> pixels;

  Picture(int w, int h, Rgb fill = {0, 0, 0});
  Rgb& at(int x, int y) { return pixels[static_cast<size_t>(y) * width + x]; }
  const Rgb& at(int x, int y) const { return pixels[static_cast<size_t>(y) * width + x]; }
};

// Printable ASCII, upper left corner at (x, y), letters about 7 * scale pixels high; what falls outside is
// cut.
void draw_text(Picture& picture, int x, int y, int scale, const std::string& text, Rgb colour);
int text_width(const std::string& text, int scale);
// Copies `part` so that its upper left corner is at (x, y); it must fit.
void paste(Picture& picture, const Picture& part, int x, int y);
// kUnavailable with the path when the file cannot be written.
Status write_png(const Picture& picture, const std::string& path);

// As a JPEG file's bytes; `quality` in [1, 100].
std::vector<uint8_t> encode_jpeg(const Picture& picture, int quality);

}  // namespace sightline
