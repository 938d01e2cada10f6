// Included inside a namespace, by cpu/tile_spans.h with T = double and once per instruction set by
// cpu/projector_vector.cpp with a vector of them, hence no include guard. One order of operations
// and no fused products: every lane gets the bits of the scalar code.
//
// Based on: the exact ellipse-tile test of Hanson et al., Speedy-Splat, CVPR 2025, and the
// opacity-aware extent of Radl et al., StopThePop, SIGGRAPH 2024. Differs: one closed form per tile
// row. The part of the ellipse inside the row is convex, so the tiles it meets are exactly those
// that its x interval meets.

/// First and last of `count` tiles in a row whose pixel centres meet [low, high] pixels; empty:
/// first > last. The ends may be far outside the picture.
template <typename T>
void tilesBetween(T low, T high, T count, T& first, T& last) {
  using std::max;
  using std::min;
  const T side(static_cast<double>(kTileSide)), per_side(1.0 / kTileSide);
  const T zero(0.0), half(0.5), one(1.0);
  // Rounded up by rounding down from above: whole parts are one instruction everywhere.
  first = count - wholePart(count - min(max((low - (side - half)) * per_side, zero), count));
  last = wholePart(min(max((high - half) * per_side + one, zero), count)) - one;
}

/// The ellipse |L d|^2 <= reach^2 of a splat, and the tiles of the box around it.
template <typename T>
struct SpanBox {
  T first_row, last_row, first_column, last_column;
  T mean_x, mean_y;
  // For a given dy the ellipse's x interval is (-l10 l11 dy -+ sqrt(reach^2 a - (l00 l11 dy)^2))/a
  // with a = l00^2 + l10^2; its rightmost point lies at dy = -l10/l11 half_x and its leftmost
  // opposite.
  T slope, across, reach_squared, inverse_a, rightmost_dy;
};

template <typename T>
void spanBox(const Footprint<T>& f, T half_x, T half_y, T columns, T rows, SpanBox<T>& box) {
  tilesBetween(f.mean_y - half_y, f.mean_y + half_y, rows, box.first_row, box.last_row);
  tilesBetween(f.mean_x - half_x, f.mean_x + half_x, columns, box.first_column, box.last_column);
  box.mean_x = f.mean_x;
  box.mean_y = f.mean_y;
  const T a = f.l00 * f.l00 + f.l10 * f.l10;
  const T reach = half_x * f.l00;
  box.inverse_a = T(1.0) / a;
  box.slope = (T(0.0) - f.l10) * f.l11;
  box.across = f.l00 * f.l11;
  box.reach_squared = reach * reach * a;
  box.rightmost_dy = (T(0.0) - f.l10) / f.l11 * half_x;
}

/// Columns of the box that the ellipse meets in a tile row; empty: first > last.
template <typename T>
void rowColumns(const SpanBox<T>& box, T row, T columns, T& first, T& last) {
  using std::max;
  using std::min;
  using std::sqrt;
  const T zero(0.0);
  const T top = row * T(static_cast<double>(kTileSide)) + T(0.5) - box.mean_y;
  const T bottom = top + T(kTileSide - 1.0);
  const T right_dy = min(max(box.rightmost_dy, top), bottom);
  const T left_dy = min(max(zero - box.rightmost_dy, top), bottom);
  const T right_across = box.across * right_dy;
  const T left_across = box.across * left_dy;
  const T right =
      (box.slope * right_dy + sqrt(max(box.reach_squared - right_across * right_across, zero))) *
      box.inverse_a;
  const T left =
      (box.slope * left_dy - sqrt(max(box.reach_squared - left_across * left_across, zero))) *
      box.inverse_a;
  tilesBetween(box.mean_x + left - boundMargin(left), box.mean_x + right + boundMargin(right),
               columns, first, last);
  first = max(first, box.first_column);
  last = min(last, box.last_column);
}
