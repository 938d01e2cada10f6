// Included inside a namespace, by cpu/tile.cpp with T = double and once per instruction set by
// cpu/tile_splats_vector.cpp with a vector of them, hence no include guard. One order of operations
// and no fused products: every lane gets the bits of the scalar code.

/// What of a TileSplat depends on the tile.
template <typename T>
struct TileSplatSteps {
  T g0, g1, l00, l10, l11;
  T largest;    ///< at least |g| + 15 |l| anywhere in the tile
  T doubt_low;  ///< as TileSplat's
  /// Rows from below the splat's lowest on and up to its highest one, not whole: the splat meets
  /// rows kTileSide - below .. above, cut to whole numbers.
  T below, above;
};

/// In: fields, as TileSplatColumns; x0 and y0, centre of the tile's first pixel; reach, of the
/// tile's TileCutOff.
template <typename T>
void tileSplatSteps(const T (&fields)[kTileSplatFields], T x0, T y0, double reach,
                    TileSplatSteps<T>& out) {
  using std::abs;
  using std::max;
  using std::min;
  constexpr double kScale = 0.84932180028801904;  // sqrt(log2(e)/2)
  const T side(static_cast<double>(kTileSide));
  const T zero(0.0);
  const T& half_y = fields[5];
  const T dx = x0 - fields[0];
  const T dy = y0 - fields[1];
  out.l00 = T(kScale) * fields[2];
  out.l10 = T(kScale) * fields[3];
  out.l11 = T(kScale) * fields[4];
  out.g0 = out.l00 * dx;
  out.g1 = out.l10 * dx + out.l11 * dy;
  // |g| <= 2.83 reach where alpha counts, and g is off by at most 4 roundings of its largest term;
  // the exponent, |g|^2 at most, by less than one of itself.
  out.largest =
      abs(out.g0) + abs(out.g1) + (side - T(1.0)) * (abs(out.l00) + abs(out.l10) + abs(out.l11));
  out.doubt_low = T(2e-6 * reach) * out.largest + T(4e-6 * reach * reach);
  out.below = min(max(side + dy + half_y, zero), side);
  out.above = min(max(half_y - dy + T(1.0), zero), side);
}
