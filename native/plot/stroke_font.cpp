#include "plot/stroke_font.h"

#include <charconv>
#include <cstring>
#include <iterator>

namespace stipple {

namespace {

/// Between two letters; strokes have a width of their own, which takes some of it.
constexpr double kLetterGap = 1.9;
/// Chords of a piece of a curve: at twice the size of this font none is told from the curve.
constexpr int kChords = 6;

/// A letter: width, then strokes. L: straight from point to point. C: a quadratic B-spline from the
/// first point to the last, drawn towards those between. O: the same, closed.
/// Letters 0x20..0x7e in their order.
constexpr const char* kLetters[] = {
    "2.2",
    "0 L0 7 0 2.4 L0 0",
    "2 L0 7 0 5 L2 7 2 5",
    "5 L1.2 0 2 7 L3.2 0 4 7 L0 2.3 5 2.3 L0 4.7 5 4.7",
    "4.2 C4.1 5.6 3.6 6.8 .2 6.8 .2 3.6 4.3 3.6 4.3 .2 .5 .2 0 1.6 L2.1 -1 2.1 8",
    "6.4 O0 3.9 2.6 3.9 2.6 7.1 0 7.1 O3.8 -.1 6.4 -.1 6.4 3.1 3.8 3.1 L5.2 7 1.2 0",
    "5 C5 0 1 4.4 .6 7.1 3.7 7.1 3.6 4.4 0 3.2 -.2 -.1 4 -.3 4.9 2.8",
    "0 L0 7 0 5",
    "1.6 C1.6 8 0 6 0 .5 1.6 -1.5",
    "1.6 C0 8 1.6 6 1.6 .5 0 -1.5",
    "3 L1.5 6.8 1.5 3.6 L.1 6 2.9 4.4 L2.9 6 .1 4.4",
    "4 L2 1.2 2 5.2 L0 3.2 4 3.2",
    "0.5 L.5 0 .4 -.4 0 -1.4",
    "2.4 L0 2.8 2.4 2.8",
    "0 L0 0",
    "3 L0 -1 3 7.6",
    "4.2 O0 -.1 4.2 -.1 4.2 3.5 4.2 7.1 0 7.1 0 3.5",
    "4.2 L.7 5.5 2.5 7 2.5 0",
    "4.2 C.1 5.3 .2 7.1 4.1 7.1 4.1 4.3 1.2 1.6 0 0 L0 0 4.2 0",
    "4.2 C.2 5.7 .4 7.1 4 7.1 4 3.8 1.5 3.8 C1.5 3.8 4.3 3.8 4.3 -.1 .2 -.1 0 1.5",
    "4.2 L3.2 0 3.2 7 0 2 4.3 2",
    "4.2 L3.8 7 .7 7 .4 3.7 C.4 3.7 1.2 4.6 4.3 4.6 4.3 -.1 .2 -.1 0 1.4",
    "4.2 C3.9 6 3.2 7.1 0 7.1 0 2.2 O0 -.1 4.2 -.1 4.2 4.4 0 4.4",
    "4.2 L0 7 4.1 7 1.5 0",
    "4.2 O.3 3.7 3.9 3.7 3.9 7.1 .3 7.1 O0 -.1 4.2 -.1 4.2 3.8 0 3.8",
    "4.2 O0 2.6 4.2 2.6 4.2 7.1 0 7.1 C4.2 4.8 4.2 -.1 1 -.1 .3 1",
    "0 L0 0 L0 4.4",
    "0.5 L.5 0 .4 -.4 0 -1.4 L.4 4.4",
    "4 L4 5.6 0 3.2 4 .8",
    "4 L0 2.2 4 2.2 L0 4.3 4 4.3",
    "4 L0 5.6 4 3.2 0 .8",
    "3.5 C0 5.6 .2 7.1 3.5 7.1 3.5 4.4 1.7 3.9 1.7 2.2 L1.7 0",
    "7 O2 1.4 5 1.4 5 5 2 5 C5 4.8 4.8 1.2 7 1.2 7 7 0 7 0 -1.4 4 -1.4 5.6 -.8",
    "5.2 L0 0 2.6 7 5.2 0 L.9 2.3 4.3 2.3",
    "4.4 L2 3.7 0 3.7 0 7 2 7 C2 7 4 7 4 3.7 2 3.7 C2 3.7 4.4 3.7 4.4 0 2 0 L2 0 0 0 0 3.7",
    "4.8 C4.8 5.5 4.1 7.1 0 7.1 0 -.1 4.1 -.1 4.8 1.5",
    "5 L1.8 0 0 0 0 7 1.8 7 C1.8 7 5.1 7 5.1 0 1.8 0",
    "4 L4 7 0 7 0 0 4 0 L0 3.7 3.4 3.7",
    "3.8 L3.9 7 0 7 0 0 L0 3.6 3.3 3.6",
    "5 C4.8 5.5 4.1 7.1 0 7.1 0 -.1 5 -.1 5 2.2 5 3.3 L5 3.3 2.9 3.3",
    "4.8 L0 0 0 7 L4.8 0 4.8 7 L0 3.6 4.8 3.6",
    "0 L0 0 0 7",
    "2.8 L2.8 7 2.8 2.2 C2.8 2.2 2.8 -.1 .3 -.1 0 1.4",
    "4.6 L0 0 0 7 L4.4 7 0 2.7 L1.6 4.2 4.7 0",
    "3.6 L0 7 0 0 3.7 0",
    "6 L0 0 0 7 3 1.8 6 7 6 0",
    "4.8 L0 0 0 7 4.8 0 4.8 7",
    "5.4 O0 -.1 5.4 -.1 5.4 7.1 0 7.1",
    "4.3 L0 0 0 7 2.3 7 C2.3 7 4.5 7 4.5 3.2 2.3 3.2 L2.3 3.2 0 3.2",
    "5.4 O0 -.1 5.4 -.1 5.4 7.1 0 7.1 L3.4 1.8 5.6 -.6",
    "4.5 L0 0 0 7 2.3 7 C2.3 7 4.5 7 4.5 3.2 2.3 3.2 L2.3 3.2 0 3.2 L2.3 3.2 4.6 0",
    "4.3 C4.1 5.7 3.6 7.1 .1 7.1 .1 3.7 4.4 3.7 4.4 -.1 .5 -.1 0 1.5",
    "4.8 L0 7 4.8 7 L2.4 7 2.4 0",
    "4.8 L0 7 0 2.4 C0 2.4 0 -.1 4.8 -.1 4.8 2.4 L4.8 2.4 4.8 7",
    "5.2 L0 7 2.6 0 5.2 7",
    "7.2 L0 7 1.8 0 3.6 6.4 5.4 0 7.2 7",
    "4.8 L0 0 4.7 7 L.1 7 4.8 0",
    "5 L0 7 2.5 3.2 5 7 L2.5 3.2 2.5 0",
    "4.6 L.1 7 4.6 7 0 0 4.7 0",
    "1.4 L1.4 8 0 8 0 -1.4 1.4 -1.4",
    "3 L0 7.6 3 -1",
    "1.4 L0 8 1.4 8 1.4 -1.4 0 -1.4",
    "3.6 L0 4.6 1.8 7 3.6 4.6",
    "4 L0 -1 4 -1",
    "1 L0 7.4 1 6",
    "3.7 C.2 4 .6 5.1 3.7 5.1 3.7 2.8 L3.7 2.8 3.7 0 C3.7 2.9 0 2.9 0 1.4 0 -.1 1.5 -.1 2.7 -.1 "
    "3.7 1.2",
    "3.9 L0 0 0 7.2 O0 -.1 3.9 -.1 3.9 5.1 0 5.1",
    "3.4 C3.6 4 3 5.1 0 5.1 0 -.1 3 -.1 3.6 1",
    "3.9 L3.9 0 3.9 7.2 O0 -.1 3.9 -.1 3.9 5.1 0 5.1",
    "3.8 L0 2.6 3.8 2.6 C3.8 2.6 3.8 5.1 0 5.1 0 -.1 3.1 -.1 3.7 1.1",
    "2.2 C2.5 7.1 .9 7.5 .9 5.2 L.9 5.2 .9 0 L-.2 4.8 2.3 4.8",
    "3.9 O0 -.1 3.9 -.1 3.9 5.1 0 5.1 L3.9 5 3.9 -.2 C3.9 -.2 3.9 -2.3 .6 -2.2 .3 -1.3",
    "3.7 L0 0 0 7.2 C0 2.8 0 5.1 3.7 5.1 3.7 2.8 L3.7 2.8 3.7 0",
    "0 L0 0 0 5 L0 6.9",
    "0.6 L.6 5 .6 -.8 C.6 -.8 .6 -2.1 -.7 -2.1 L.6 6.9",
    "3.5 L0 0 0 7.2 L3.3 5 0 1.9 L1.3 3.1 3.6 0",
    "0.3 L.1 7.2 .1 0",
    "6.2 L0 0 0 5 C0 2.8 0 5.1 3.1 5.1 3.1 2.8 L3.1 2.8 3.1 0 C3.1 2.8 3.1 5.1 6.2 5.1 6.2 2.8 "
    "L6.2 2.8 6.2 0",
    "3.7 L0 0 0 5 C0 2.8 0 5.1 3.7 5.1 3.7 2.8 L3.7 2.8 3.7 0",
    "4 O0 -.1 4 -.1 4 5.1 0 5.1",
    "3.9 L0 -2 0 5 O0 -.1 3.9 -.1 3.9 5.1 0 5.1",
    "3.9 L3.9 -2 3.9 5 O0 -.1 3.9 -.1 3.9 5.1 0 5.1",
    "2.1 L0 0 0 5 C0 2.6 0 5.1 2.3 5",
    "3.3 C3.2 4 2.8 5.1 .1 5.1 .1 2.6 3.4 2.6 3.4 -.1 .4 -.1 0 1.1",
    "2.3 L.9 6.6 .9 1.4 C.9 1.4 .9 -.2 2.4 .1 L-.2 4.8 2.3 4.8",
    "3.7 L0 5 0 2.2 C0 2.2 0 -.1 3.7 -.1 3.7 2.2 L3.7 5 3.7 0",
    "3.8 L0 5 1.9 0 3.8 5",
    "5.6 L0 5 1.4 0 2.8 4.6 4.2 0 5.6 5",
    "3.6 L0 0 3.5 5 L.1 5 3.6 0",
    "3.8 L0 5 1.9 .1 L3.8 5 1.6 -.9 C1.6 -.9 1.1 -2.2 0 -2",
    "3.4 L.1 5 3.4 5 0 0 3.5 0",
    "2 C2 8 .8 8 .8 3.3 0 3.3 C2 -1.4 .8 -1.4 .8 3.3 0 3.3",
    "0 L0 8 0 -1.4",
    "2 C0 8 1.2 8 1.2 3.3 2 3.3 C0 -1.4 1.2 -1.4 1.2 3.3 2 3.3",
    "4.2 C0 2.6 .6 4.4 2.1 3.2 3.6 2 4.2 3.8",
};
static_assert(std::size(kLetters) == 0x7f - 0x20);

const char* letterOf(char c) {
  const auto index = static_cast<unsigned char>(c) - 0x20u;
  return kLetters[index < std::size(kLetters) ? index : '?' - 0x20u];
}

/// Reads the number at `text` and steps behind it.
double numberAt(const char*& text) {
  while (*text == ' ') ++text;
  double value = 0;
  text = std::from_chars(text, text + std::strlen(text), value).ptr;
  return value;
}

std::array<double, 2> between(const std::array<double, 2>& a, const std::array<double, 2>& b,
                              double t) {
  return {a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])};
}

/// A uniform quadratic B-spline as chords: pieces run between the middles of the sides of its
/// control polygon; an open one starts and ends at its ends.
PenStroke curve(const PenStroke& control, bool is_closed) {
  const size_t n = control.size();
  PenStroke stroke;
  if (!is_closed && n < 3) return control;
  const size_t first = is_closed ? 0 : 1, last = is_closed ? n : n - 1;
  for (size_t i = first; i < last; ++i) {
    const auto& before = control[(i + n - 1) % n];
    const auto& here = control[i];
    const auto& after = control[(i + 1) % n];
    const auto from = !is_closed && i == first ? before : between(before, here, 0.5);
    const auto to = !is_closed && i + 1 == last ? after : between(here, after, 0.5);
    for (int k = stroke.empty() ? 0 : 1; k <= kChords; ++k) {
      const double t = static_cast<double>(k) / kChords;
      stroke.push_back(between(between(from, here, t), between(here, to, t), t));
    }
  }
  return stroke;
}

}  // namespace

double penWidth(const std::string& text) {
  double width = 0;
  for (const char c : text) {
    const char* letter = letterOf(c);
    width += numberAt(letter) + kLetterGap;
  }
  return text.empty() ? 0 : width - kLetterGap;
}

std::vector<PenStroke> penStrokes(const std::string& text) {
  std::vector<PenStroke> strokes;
  double left = 0;
  for (const char c : text) {
    const char* letter = letterOf(c);
    const double width = numberAt(letter);
    while (*letter == ' ') ++letter;
    while (*letter != '\0') {
      const char kind = *letter++;
      PenStroke points;
      while (*letter != '\0' && *letter != 'L' && *letter != 'C' && *letter != 'O') {
        const double x = numberAt(letter), y = numberAt(letter);
        points.push_back({left + x, y});
        while (*letter == ' ') ++letter;
      }
      strokes.push_back(kind == 'L' ? points : curve(points, kind == 'O'));
    }
    left += width + kLetterGap;
  }
  return strokes;
}

}  // namespace stipple
