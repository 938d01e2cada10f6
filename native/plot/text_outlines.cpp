#include "plot/text_outlines.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "base/error.h"
#include "plot/font/font_data.h"

#define STB_TRUETYPE_IMPLEMENTATION
#define STBTT_STATIC
#include <stb/stb_truetype.h>

namespace stipple {

namespace {

/// Pixels between an outline's curve and the chords that stand for it: a tenth is seen by nobody.
constexpr float kFlatness = 0.1f;

stbtt_fontinfo opened(const unsigned char* bytes) {
  stbtt_fontinfo font;
  if (stbtt_InitFont(&font, bytes, 0) == 0) {
    fail(ErrorCode::kInternal, "the font of plots cannot be read");
  }
  return font;
}

const stbtt_fontinfo& fontOf(bool is_bold) {
  static const stbtt_fontinfo kRegular = opened(kSansRegular.data());
  static const stbtt_fontinfo kBold = opened(kSansBold.data());
  return is_bold ? kBold : kRegular;
}

/// Glyphs of a text in UTF-8.
std::vector<int> glyphsOf(const stbtt_fontinfo& font, const std::string& text) {
  std::vector<int> glyphs;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if ((byte & 0xc0u) == 0x80u) continue;  // goes on with a character
    const int glyph = stbtt_FindGlyphIndex(&font, byte < 0x80u ? byte : '?');
    glyphs.push_back(glyph != 0 ? glyph : stbtt_FindGlyphIndex(&font, '?'));
  }
  return glyphs;
}

/// From a glyph's start to that of the next, in units of the font. In: next, or -1.
int advanceOf(const stbtt_fontinfo& font, int glyph, int next) {
  int advance = 0, bearing = 0;
  stbtt_GetGlyphHMetrics(&font, glyph, &advance, &bearing);
  return advance + (next < 0 ? 0 : stbtt_GetGlyphKernAdvance(&font, glyph, next));
}

/// A glyph's outline, whose corners and control points are rotated where text runs upwards.
class Outline {
 public:
  Outline(const stbtt_fontinfo& font, int glyph, bool is_upright) : font_(font) {
    count_ = stbtt_GetGlyphShape(&font_, glyph, &points_);
    if (is_upright) return;
    for (int i = 0; i < count_; ++i) {
      rotate(points_[i].x, points_[i].y);
      rotate(points_[i].cx, points_[i].cy);
    }
  }
  ~Outline() { stbtt_FreeShape(&font_, points_); }
  Outline(const Outline&) = delete;
  Outline& operator=(const Outline&) = delete;

  /// In: scale, pixels of a unit; (x, y), where the glyph starts, in pixels.
  void cover(float scale, double x, double y, const VisitCovered& visit) const {
    if (count_ == 0) return;
    int low_x = points_[0].x, high_x = low_x, low_y = points_[0].y, high_y = low_y;
    const auto extend = [&](int px, int py) {
      low_x = std::min(low_x, px);
      high_x = std::max(high_x, px);
      low_y = std::min(low_y, py);
      high_y = std::max(high_y, py);
    };
    for (int i = 0; i < count_; ++i) {
      extend(points_[i].x, points_[i].y);
      if (points_[i].type == STBTT_vcurve) extend(points_[i].cx, points_[i].cy);
    }
    const double pixels = static_cast<double>(scale);
    const int left = static_cast<int>(std::floor(x + pixels * low_x));
    const int top = static_cast<int>(std::floor(y - pixels * high_y));
    const int right = static_cast<int>(std::ceil(x + pixels * high_x)) + 1;
    const int bottom = static_cast<int>(std::ceil(y - pixels * low_y)) + 1;
    std::vector<unsigned char> shares(static_cast<size_t>(right - left) *
                                      static_cast<size_t>(bottom - top));
    stbtt__bitmap bitmap;
    bitmap.w = bitmap.stride = right - left;
    bitmap.h = bottom - top;
    bitmap.pixels = shares.data();
    // Small shifts, so that single precision keeps them.
    stbtt_Rasterize(&bitmap, kFlatness, points_, count_, scale, scale, static_cast<float>(x - left),
                    static_cast<float>(y - top), 0, 0, 1, nullptr);
    for (int row = 0; row < bitmap.h; ++row) {
      for (int column = 0; column < bitmap.w; ++column) {
        const unsigned char share = shares[static_cast<size_t>(row * bitmap.w + column)];
        if (share > 0) visit(left + column, top + row, static_cast<float>(share) / 255.0f);
      }
    }
  }

 private:
  static void rotate(stbtt_vertex_type& x, stbtt_vertex_type& y) {
    const stbtt_vertex_type along = x;
    x = static_cast<stbtt_vertex_type>(-y);
    y = along;
  }

  const stbtt_fontinfo& font_;
  stbtt_vertex* points_ = nullptr;
  int count_ = 0;
};

/// Visits each glyph with its place on the baseline, in units of the font; returns the length.
template <typename Visit>
int layOut(const stbtt_fontinfo& font, const std::string& text, const Visit& visit) {
  const std::vector<int> glyphs = glyphsOf(font, text);
  int along = 0;
  for (size_t i = 0; i < glyphs.size(); ++i) {
    visit(glyphs[i], along);
    along += advanceOf(font, glyphs[i], i + 1 < glyphs.size() ? glyphs[i + 1] : -1);
  }
  return along;
}

float scaleOf(const stbtt_fontinfo& font, const OutlinedText& text) {
  return stbtt_ScaleForMappingEmToPixels(&font, static_cast<float>(text.size_px));
}

}  // namespace

double lengthOf(const OutlinedText& text) {
  const stbtt_fontinfo& font = fontOf(text.is_bold);
  return static_cast<double>(scaleOf(font, text)) * layOut(font, text.text, [](int, int) {});
}

void coverText(const OutlinedText& text, const VisitCovered& visit) {
  const stbtt_fontinfo& font = fontOf(text.is_bold);
  const float scale = scaleOf(font, text);
  layOut(font, text.text, [&](int glyph, int along) {
    const double pixels = static_cast<double>(scale) * along;
    const Outline outline(font, glyph, text.is_upright);
    outline.cover(scale, text.is_upright ? text.x + pixels : text.x,
                  text.is_upright ? text.y : text.y - pixels, visit);
  });
}

}  // namespace stipple
