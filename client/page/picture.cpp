#include "client/page/picture.h"

#include <algorithm>
#include <cassert>
#include <cstring>

#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#include <stb/stb_easy_font.h>
#include <stb/stb_image_write.h>

namespace sightline {
namespace {

// A vertex as stb_easy_font_print writes it: four for each upright rectangle, with the corners in order.
struct FontVertex {
  float x, y, z;
  uint8_t colour[4];
};
static_assert(sizeof(FontVertex) == 16);

void fill(Picture& picture, int x0, int y0, int x1, int y1, Rgb colour) {
  for (int y = std::max(0, y0); y < std::min(picture.height, y1); ++y)
    for (int x = std::max(0, x0); x < std::min(picture.width, x1); ++x) picture.at(x, y) = colour;
}

}  // namespace

Picture::Picture(int w, int h, Rgb fill_with)
    : width(w), height(h), pixels(static_cast<size_t>(w) * static_cast<size_t>(h), fill_with) {}

void draw_text(Picture& picture, int x, int y, int scale, const std::string& text, Rgb colour) {
  std::string line = text;  // stb takes a char*
  std::vector<FontVertex> vertices(text.size() * 80);
  const int quads = stb_easy_font_print(0, 0, line.data(), nullptr, vertices.data(),
                                        static_cast<int>(vertices.size() * sizeof(FontVertex)));
  const auto pixel = [scale](float value) { return static_cast<int>(value * static_cast<float>(scale)); };
  for (int quad = 0; quad < quads; ++quad) {
    const FontVertex &low = vertices[4 * quad], &high = vertices[4 * quad + 2];
    fill(picture, x + pixel(low.x), y + pixel(low.y), x + pixel(high.x), y + pixel(high.y), colour);
  }
}

int text_width(const std::string& text, int scale) {
  std::string line = text;
  return scale * stb_easy_font_width(line.data());
}

void paste(Picture& picture, const Picture& part, int x, int y) {
  assert(x >= 0 && y >= 0 && x + part.width <= picture.width && y + part.height <= picture.height);
  for (int row = 0; row < part.height; ++row) std::copy_n(&part.at(0, row), part.width, &picture.at(x, y + row));
}

Status write_png(const Picture& picture, const std::string& path) {
  if (!stbi_write_png(path.c_str(), picture.width, picture.height, 3, picture.pixels.data(), 3 * picture.width))
    return fail(ErrorCode::kUnavailable, path, "cannot be written");
  return {};
}

std::vector<uint8_t> encode_jpeg(const Picture& picture, int quality) {
  std::vector<uint8_t> bytes;
  const auto append = [](void* to, void* data, int size) {
    const auto* first = static_cast<const uint8_t*>(data);
    static_cast<std::vector<uint8_t>*>(to)->insert(static_cast<std::vector<uint8_t>*>(to)->end(), first, first + size);
  };
  stbi_write_jpg_to_func(append, &bytes, picture.width, picture.height, 3, picture.pixels.data(), quality);
  return bytes;
}

}  // namespace sightline
