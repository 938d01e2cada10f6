// Bits of a compressed PLY to float32, in lanes. The scalar loops say what is computed; lanes do
// the same operations in the same order.
#include "io/splats/ply/ply_compressed_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "io/splats/ply/ply_compressed_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// Behind it.
#include <hwy/contrib/math/math-inl.h>

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

PlyChunkKernel chunkKernel() {
  return plainPlyChunkKernel();
}

#else

namespace hn = hwy::HWY_NAMESPACE;

using Doubles = hn::ScalableTag<double>;
using Words = hn::Rebind<uint32_t, Doubles>;
using Signed = hn::Rebind<int32_t, Doubles>;
using HalfFloats = hn::Rebind<float, Doubles>;
using Floats = hn::ScalableTag<float>;
using Row = std::array<float, kPlyChunkSplats>;

/// Bits [kShift, kShift + kBits) of the words as numbers.
template <int kShift, uint32_t kLast>
HWY_INLINE hn::Vec<Doubles> stepsAt(const uint32_t* words) {
  const auto shifted = hn::ShiftRight<kShift>(hn::LoadU(Words(), words));
  const auto steps = hn::And(shifted, hn::Set(Words(), kLast));
  return hn::PromoteTo(Doubles(), hn::BitCast(Signed(), steps));
}

/// low + steps * (high - low) / last, and then (value + offset) * factor.
template <int kShift, uint32_t kLast>
HWY_INLINE void spread(const std::array<uint32_t, kPlyChunkSplats>& words, float low, float high,
                       double offset, double factor, Row& out) {
  const Doubles d;
  const auto from = hn::Set(d, static_cast<double>(low));
  const auto step =
      hn::Set(d, (static_cast<double>(high) - static_cast<double>(low)) / double{kLast});
  const auto add = hn::Set(d, offset);
  const auto times = hn::Set(d, factor);
  for (size_t i = 0; i < kPlyChunkSplats; i += hn::Lanes(d)) {
    const auto value = hn::Add(from, hn::Mul(stepsAt<kShift, kLast>(&words[i]), step));
    hn::StoreU(hn::DemoteTo(HalfFloats(), hn::Mul(hn::Add(value, add), times)), HalfFloats(),
               &out[i]);
  }
}

/// One component of a rotation, between -sqrt(1/2) and sqrt(1/2).
template <int kShift>
HWY_INLINE hn::Vec<Doubles> componentAt(const uint32_t* words) {
  const auto steps = stepsAt<kShift, 1023>(words);
  return hn::Mul(hn::Sub(hn::Mul(steps, hn::Set(Doubles(), 1.0 / 1023.0)), hn::Set(Doubles(), 0.5)),
                 hn::Set(Doubles(), 1.4142135623730951));
}

/// The three that are stored and the largest: a, b, c in the order w, x, y, z, and d.
HWY_INLINE void rotationParts(const std::array<uint32_t, kPlyChunkSplats>& words,
                              std::array<Row, 4>& out) {
  const Doubles d;
  const auto one = hn::Set(d, 1.0);
  for (size_t i = 0; i < kPlyChunkSplats; i += hn::Lanes(d)) {
    const auto a = componentAt<20>(&words[i]);
    const auto b = componentAt<10>(&words[i]);
    const auto c = componentAt<0>(&words[i]);
    const auto squares = hn::Add(hn::Add(hn::Mul(c, c), hn::Mul(b, b)), hn::Mul(a, a));
    const auto largest = hn::Sqrt(hn::Max(hn::Zero(d), hn::Sub(one, squares)));
    // Three components at their ends are longer than a unit quaternion.
    const auto length = hn::Sqrt(hn::Max(one, squares));
    hn::StoreU(hn::DemoteTo(HalfFloats(), hn::Div(a, length)), HalfFloats(), &out[0][i]);
    hn::StoreU(hn::DemoteTo(HalfFloats(), hn::Div(b, length)), HalfFloats(), &out[1][i]);
    hn::StoreU(hn::DemoteTo(HalfFloats(), hn::Div(c, length)), HalfFloats(), &out[2][i]);
    hn::StoreU(hn::DemoteTo(HalfFloats(), largest), HalfFloats(), &out[3][i]);
  }
}

void decode(const PlyChunkBits& bits, const PlyChunkRange& range, const PlyChunkTarget& out) {
  const Floats d;
  const hn::RebindToUnsigned<Floats> words;
  const hn::RebindToSigned<Floats> ints;
  std::array<Row, 4> rows;
  spread<21, 2047>(bits[0], range[0], range[3], 0.0, 1.0, rows[0]);
  spread<11, 1023>(bits[0], range[1], range[4], 0.0, 1.0, rows[1]);
  spread<0, 2047>(bits[0], range[2], range[5], 0.0, 1.0, rows[2]);
  for (size_t i = 0; i < kPlyChunkSplats; i += hn::Lanes(d)) {
    hn::StoreInterleaved3(hn::LoadU(d, &rows[0][i]), hn::LoadU(d, &rows[1][i]),
                          hn::LoadU(d, &rows[2][i]), d, out.positions + i * 3);
  }
  rotationParts(bits[1], rows);
  for (size_t i = 0; i < kPlyChunkSplats; i += hn::Lanes(d)) {
    const auto a = hn::LoadU(d, &rows[0][i]);
    const auto b = hn::LoadU(d, &rows[1][i]);
    const auto c = hn::LoadU(d, &rows[2][i]);
    const auto largest = hn::LoadU(d, &rows[3][i]);
    const auto place = hn::BitCast(ints, hn::ShiftRight<30>(hn::LoadU(words, &bits[1][i])));
    const auto is0 = hn::RebindMask(d, hn::Eq(place, hn::Zero(ints)));
    const auto is1 = hn::RebindMask(d, hn::Eq(place, hn::Set(ints, 1)));
    const auto is2 = hn::RebindMask(d, hn::Eq(place, hn::Set(ints, 2)));
    const auto is3 = hn::RebindMask(d, hn::Eq(place, hn::Set(ints, 3)));
    const auto x = hn::IfThenElse(is0, a, hn::IfThenElse(is1, largest, b));
    const auto y = hn::IfThenElse(hn::Or(is0, is1), b, hn::IfThenElse(is2, largest, c));
    hn::StoreInterleaved4(hn::IfThenElse(is0, largest, a), x, y, hn::IfThenElse(is3, largest, c), d,
                          out.rotations + i * 4);
    const auto opacity = hn::And(hn::LoadU(words, &bits[3][i]), hn::Set(words, 255));
    hn::StoreU(hn::Div(hn::ConvertTo(d, hn::BitCast(ints, opacity)), hn::Set(d, 255.0f)), d,
               out.opacities + i);
  }
  std::array<Row, 3>& colours = *out.harmonics;
  spread<24, 255>(bits[3], range[12], range[15], -0.5, 1.0 / kPlyChunkC0, colours[0]);
  spread<16, 255>(bits[3], range[13], range[16], -0.5, 1.0 / kPlyChunkC0, colours[1]);
  spread<8, 255>(bits[3], range[14], range[17], -0.5, 1.0 / kPlyChunkC0, colours[2]);
}

/// Every row's bytes in the cloud's order first, then to floats.
void decodeHarmonics(const PlyHarmonicRows& rows, float* sh) {
  const hn::FixedTag<uint8_t, 16> bytes;
  const hn::CappedTag<float, 16> d;
  const hn::Rebind<int32_t, decltype(d)> ints;
  const hn::Rebind<uint8_t, decltype(d)> narrow;
  constexpr size_t kPlaces = PlyHarmonicRows::kReadable;
  // Of each 16 places, which byte of each 16 of the row goes there; 0x80: none of them.
  alignas(16) uint8_t table[3][3][16];
  for (size_t place = 0; place < kPlaces; ++place) {
    const bool stored = place >= 3 && place - 3 < rows.row_bytes;
    const size_t from = stored ? rows.from[place - 3] : kPlaces;
    for (size_t part = 0; part < 3; ++part) {
      table[place / 16][part][place % 16] =
          static_cast<uint8_t>(from / 16 == part ? from % 16 : 0x80);
    }
  }
  const auto scale = hn::Set(d, 1.0f / 32.0f);
  const auto middle = hn::Set(d, 3.984375f);
  const auto end = hn::Set(d, 4.0f);
  const auto low = hn::Set(d, -3.98f);
  const auto high = hn::Set(d, 3.98f);
  const size_t stride = 3 + rows.row_bytes;
  alignas(64) uint8_t ordered[kPlaces];
  alignas(64) float values[kPlaces];
  for (size_t i = 0; i < rows.count; ++i) {
    const uint8_t* row = rows.bytes + i * rows.row_bytes;
    const auto first = hn::LoadU(bytes, row);
    const auto second = hn::LoadU(bytes, row + 16);
    const auto third = hn::LoadU(bytes, row + 32);
    for (size_t part = 0; part < 3; ++part) {
      const auto a = hn::TableLookupBytesOr0(first, hn::Load(bytes, table[part][0]));
      const auto b = hn::TableLookupBytesOr0(second, hn::Load(bytes, table[part][1]));
      const auto c = hn::TableLookupBytesOr0(third, hn::Load(bytes, table[part][2]));
      hn::Store(hn::Or(hn::Or(a, b), c), bytes, ordered + part * 16);
    }
    float* out = stride == kPlaces ? sh + i * stride : values;
    for (size_t place = 0; place < kPlaces; place += hn::Lanes(d)) {
      const auto byte = hn::PromoteTo(ints, hn::LoadU(narrow, ordered + place));
      const auto value = hn::Sub(hn::Mul(hn::ConvertTo(d, byte), scale), middle);
      const auto at_low = hn::IfThenElse(hn::Lt(value, low), hn::Neg(end), value);
      hn::StoreU(hn::IfThenElse(hn::Gt(value, high), end, at_low), d, out + place);
    }
    if (out == values) {
      for (size_t k = 0; k < stride; ++k) sh[i * stride + k] = values[k];
    }
  }
}

/// A number whose sign is set where one of the values has been infinite or NaN.
class FiniteCheck {
 public:
  HWY_INLINE FiniteCheck() : wrong_(hn::Zero(hn::RebindToUnsigned<Floats>())) {}
  HWY_INLINE void take(hn::Vec<Floats> values) {
    const hn::RebindToUnsigned<Floats> words;
    const auto magnitude = hn::And(hn::BitCast(words, values), hn::Set(words, 0x7fffffffu));
    // Carries into the sign where the exponent is all ones.
    wrong_ = hn::Or(wrong_, hn::Add(magnitude, hn::Set(words, 0x00800000u)));
  }
  HWY_INLINE void takeWrong(hn::Mask<Floats> mask) {
    const hn::RebindToUnsigned<Floats> words;
    wrong_ = hn::Or(wrong_,
                    hn::IfThenElseZero(hn::RebindMask(words, mask), hn::Set(words, 0x80000000u)));
  }
  HWY_INLINE bool passed() const {
    const hn::RebindToUnsigned<Floats> words;
    return hn::AllTrue(words, hn::Lt(wrong_, hn::Set(words, 0x80000000u)));
  }

 private:
  hn::Vec<hn::RebindToUnsigned<Floats> > wrong_ = hn::Zero(hn::RebindToUnsigned<Floats>());
};

HWY_INLINE bool areValid(const PlyChunkValues& values) {
  const Floats d;
  const auto zero = hn::Zero(d);
  FiniteCheck check;
  for (size_t i = 0; i < kPlyChunkSplats; i += hn::Lanes(d)) {
    for (size_t k = 0; k < 9; ++k) check.take(hn::LoadU(d, &values.ranged[k][i]));
    for (size_t k = 3; k < 6; ++k) {
      check.takeWrong(hn::Lt(hn::LoadU(d, &values.ranged[k][i]), zero));
    }
    const auto opacity = hn::LoadU(d, &values.opacity[i]);
    check.take(opacity);
    check.takeWrong(hn::Or(hn::Lt(opacity, zero), hn::Gt(opacity, hn::Set(d, 1.0f))));
    auto is_zero = hn::Eq(zero, zero);
    for (size_t k = 0; k < 4; ++k) {
      const auto part = hn::LoadU(d, &values.rotation[k][i]);
      check.take(part);
      is_zero = hn::And(is_zero, hn::Eq(part, zero));
    }
    check.takeWrong(is_zero);
  }
  return check.passed();
}

/// The nearest whole numbers 0..last.
HWY_INLINE hn::Vec<Words> nearestSteps(hn::Vec<Doubles> values, hn::Vec<Doubles> last) {
  const Doubles d;
  const auto held = hn::Min(hn::Max(values, hn::Zero(d)), last);
  return hn::BitCast(Words(), hn::DemoteTo(Signed(), hn::Add(held, hn::Set(d, 0.5))));
}

struct AsItIs {
  HWY_INLINE hn::Vec<Doubles> operator()(hn::Vec<Doubles> value) const { return value; }
};
struct Logarithm {
  HWY_INLINE hn::Vec<Doubles> operator()(hn::Vec<Doubles> value) const {
    const Doubles d;
    const auto limit = hn::Set(d, kPlyLogLimit);
    // Below e^-21 any number does.
    const auto log = hn::Log(d, hn::Max(value, hn::Set(d, 1e-10)));
    return hn::Max(hn::Min(log, limit), hn::Neg(limit));
  }
};
struct Colour {
  HWY_INLINE hn::Vec<Doubles> operator()(hn::Vec<Doubles> value) const {
    const Doubles d;
    return hn::Add(hn::Mul(value, hn::Set(d, kPlyChunkC0)), hn::Set(d, 0.5));
  }
};

/// Adds the steps of one attribute to the words, at their place.
template <int kShift, uint32_t kLast, class Map>
HWY_INLINE void quantise(const Row& values, const Map& map, float* low, float* high,
                         std::array<uint32_t, kPlyChunkSplats>& words) {
  const Doubles d;
  const HalfFloats half;
  std::array<double, kPlyChunkSplats> mapped;
  auto least = hn::Set(half, hwy::HighestValue<float>());
  auto most = hn::Set(half, hwy::LowestValue<float>());
  for (size_t i = 0; i < kPlyChunkSplats; i += hn::Lanes(d)) {
    const auto value = map(hn::PromoteTo(d, hn::LoadU(half, &values[i])));
    const auto rounded = hn::DemoteTo(half, value);
    least = hn::Min(least, rounded);
    most = hn::Max(most, rounded);
    hn::StoreU(value, d, &mapped[i]);
  }
  *low = hn::GetLane(hn::MinOfLanes(half, least));
  *high = hn::GetLane(hn::MaxOfLanes(half, most));
  const double extent = static_cast<double>(*high) - static_cast<double>(*low);
  const auto from = hn::Set(d, static_cast<double>(*low));
  const auto to_steps = hn::Set(d, extent > 0 ? kLast / extent : 0.0);
  const auto last = hn::Set(d, double{kLast});
  for (size_t i = 0; i < kPlyChunkSplats; i += hn::Lanes(d)) {
    const auto steps =
        nearestSteps(hn::Mul(hn::Sub(hn::LoadU(d, &mapped[i]), from), to_steps), last);
    const auto before = hn::LoadU(Words(), &words[i]);
    hn::StoreU(hn::Or(before, hn::ShiftLeft<kShift>(steps)), Words(), &words[i]);
  }
}

HWY_INLINE void packRotations(const std::array<PlyChunkValues::Values, 4>& rotation,
                              std::array<uint32_t, kPlyChunkSplats>& words) {
  const Doubles d;
  const HalfFloats half;
  const auto last = hn::Set(d, 1023.0);
  const auto middle = hn::Set(d, 0.5);
  for (size_t i = 0; i < kPlyChunkSplats; i += hn::Lanes(d)) {
    const auto w = hn::PromoteTo(d, hn::LoadU(half, &rotation[0][i]));
    const auto x = hn::PromoteTo(d, hn::LoadU(half, &rotation[1][i]));
    const auto y = hn::PromoteTo(d, hn::LoadU(half, &rotation[2][i]));
    const auto z = hn::PromoteTo(d, hn::LoadU(half, &rotation[3][i]));
    // Each where it is larger than all before it.
    const auto is1 = hn::Gt(hn::Abs(x), hn::Abs(w));
    const auto most1 = hn::IfThenElse(is1, x, w);
    const auto is2 = hn::Gt(hn::Abs(y), hn::Abs(most1));
    const auto most2 = hn::IfThenElse(is2, y, most1);
    const auto is3 = hn::Gt(hn::Abs(z), hn::Abs(most2));
    const auto most = hn::IfThenElse(is3, z, most2);
    const auto place = hn::IfThenElse(
        is3, hn::Set(d, 3.0),
        hn::IfThenElse(is2, hn::Set(d, 2.0), hn::IfThenElseZero(is1, hn::Set(d, 1.0))));
    const auto at0 = hn::Eq(place, hn::Zero(d));
    const auto squares =
        hn::Add(hn::Add(hn::Add(hn::Mul(w, w), hn::Mul(x, x)), hn::Mul(y, y)), hn::Mul(z, z));
    const auto size = hn::Div(hn::Set(d, 0.7071067811865476), hn::Sqrt(squares));
    const auto factor = hn::IfThenElse(hn::Lt(most, hn::Zero(d)), hn::Neg(size), size);
    const auto pack = [&](hn::Vec<Doubles> part) HWY_ATTR {
      return nearestSteps(hn::Mul(hn::Add(hn::Mul(part, factor), middle), last), last);
    };
    const auto a = pack(hn::IfThenElse(at0, x, w));
    const auto b = pack(hn::IfThenElse(hn::Lt(place, hn::Set(d, 1.5)), y, x));
    const auto c = pack(hn::IfThenElse(is3, y, z));
    const auto index = hn::BitCast(Words(), hn::DemoteTo(Signed(), place));
    const auto packed = hn::Or(hn::Or(hn::ShiftLeft<30>(index), hn::ShiftLeft<20>(a)),
                               hn::Or(hn::ShiftLeft<10>(b), c));
    hn::StoreU(packed, Words(), &words[i]);
  }
}

bool encode(const PlyChunkValues& values, PlyChunkRange& range, PlyChunkBits& bits) {
  const Doubles d;
  if (!areValid(values)) return false;
  for (size_t k : {0, 2}) bits[k].fill(0);
  quantise<21, 2047>(values.ranged[0], AsItIs(), &range[0], &range[3], bits[0]);
  quantise<11, 1023>(values.ranged[1], AsItIs(), &range[1], &range[4], bits[0]);
  quantise<0, 2047>(values.ranged[2], AsItIs(), &range[2], &range[5], bits[0]);
  packRotations(values.rotation, bits[1]);
  quantise<21, 2047>(values.ranged[3], Logarithm(), &range[6], &range[9], bits[2]);
  quantise<11, 1023>(values.ranged[4], Logarithm(), &range[7], &range[10], bits[2]);
  quantise<0, 2047>(values.ranged[5], Logarithm(), &range[8], &range[11], bits[2]);
  const auto most = hn::Set(d, 255.0);
  for (size_t i = 0; i < kPlyChunkSplats; i += hn::Lanes(d)) {
    const auto opacity = hn::PromoteTo(d, hn::LoadU(HalfFloats(), &values.opacity[i]));
    hn::StoreU(nearestSteps(hn::Mul(opacity, most), most), Words(), &bits[3][i]);
  }
  quantise<24, 255>(values.ranged[6], Colour(), &range[12], &range[15], bits[3]);
  quantise<16, 255>(values.ranged[7], Colour(), &range[13], &range[16], bits[3]);
  quantise<8, 255>(values.ranged[8], Colour(), &range[14], &range[17], bits[3]);
  return true;
}

/// Rows to bytes in the cloud's order first, then each where it goes. 32 v + 128 counts in parts;
/// taken apart, so that float32 has room for it.
bool encodeHarmonics(const PlyHarmonicSources& sources, uint8_t* bytes) {
  const hn::FixedTag<uint8_t, 16> sixteen;
  const Floats d;
  const hn::RebindToSigned<Floats> ints;
  const hn::Rebind<uint8_t, Floats> narrow;
  constexpr size_t kPlaces = PlyHarmonicRows::kReadable;
  constexpr size_t kAhead = 6;
  // Of each 16 bytes of the file, which of each 16 places of the row goes there; 0x80: none.
  alignas(16) uint8_t table[3][3][16];
  for (auto& third : table) {
    for (auto& part : third) {
      for (uint8_t& entry : part) entry = 0x80;
    }
  }
  for (size_t k = 0; k < sources.numbers; ++k) {
    const size_t to = sources.to[k];
    table[to / 16][(k + 3) / 16][to % 16] = static_cast<uint8_t>((k + 3) % 16);
  }
  const auto end = hn::Set(d, 128.0f);
  const auto nearly = hn::Set(d, 127.25f);
  const auto nothing = hn::Set(d, -0x1p-47f);
  const size_t stride = 3 + sources.numbers;
  alignas(64) float padded[kPlaces] = {};
  alignas(64) uint8_t ordered[kPlaces];
  FiniteCheck check;
  for (size_t i = 0; i < sources.count; ++i) {
    const float* row = sources.rows[i];
    if (i + kAhead < sources.count) {
      const float* next = sources.rows[i + kAhead];
      for (size_t k = 0; k < stride; k += 16) __builtin_prefetch(next + k);
    }
    if (stride != kPlaces) {
      for (size_t k = 0; k < stride; ++k) padded[k] = row[k];
      row = padded;
    }
    for (size_t place = 0; place < kPlaces; place += hn::Lanes(d)) {
      const auto value = hn::LoadU(d, row + place);
      check.take(value);
      const auto parts = hn::Max(hn::Min(hn::Mul(value, hn::Set(d, 32.0f)), end), hn::Neg(end));
      const auto whole = hn::ConvertTo(ints, parts);  // towards 0
      const auto is_below = hn::And(hn::Lt(parts, hn::ConvertTo(d, whole)), hn::Lt(parts, nothing));
      const auto below =
          hn::Sub(whole, hn::IfThenElseZero(hn::RebindMask(ints, is_below), hn::Set(ints, 1)));
      const auto middle = hn::Min(hn::Max(hn::Add(below, hn::Set(ints, 128)), hn::Set(ints, 1)),
                                  hn::Set(ints, 254));
      // The bytes at the ends stand for the ends and not for the middle of their part.
      const auto at_low = hn::RebindMask(ints, hn::Le(parts, hn::Neg(nearly)));
      const auto at_high = hn::RebindMask(ints, hn::Ge(parts, nearly));
      const auto byte = hn::IfThenElse(at_high, hn::Set(ints, 255),
                                       hn::IfThenElse(at_low, hn::Zero(ints), middle));
      hn::StoreU(hn::DemoteTo(narrow, byte), narrow, ordered + place);
    }
    const auto first = hn::Load(sixteen, ordered);
    const auto second = hn::Load(sixteen, ordered + 16);
    const auto third = hn::Load(sixteen, ordered + 32);
    uint8_t* out = bytes + i * sources.numbers;
    for (size_t part = 0; part * 16 < sources.numbers; ++part) {
      const auto a = hn::TableLookupBytesOr0(first, hn::Load(sixteen, table[part][0]));
      const auto b = hn::TableLookupBytesOr0(second, hn::Load(sixteen, table[part][1]));
      const auto c = hn::TableLookupBytesOr0(third, hn::Load(sixteen, table[part][2]));
      hn::StoreU(hn::Or(hn::Or(a, b), c), sixteen, out + part * 16);
    }
  }
  return check.passed();
}

PlyChunkKernel chunkKernel() {
  return {hwy::TargetName(HWY_TARGET), decode, decodeHarmonics, encode, encodeHarmonics};
}

#endif  // HWY_TARGET == HWY_SCALAR

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "base/kernel_choice.h"

namespace stipple {

HWY_EXPORT(chunkKernel);

namespace {

PlyChunkKernel dispatched() {
  return HWY_DYNAMIC_DISPATCH(chunkKernel)();
}

}  // namespace

std::vector<PlyChunkKernel> plyChunkKernels() {
  return onEveryTarget(plainPlyChunkKernel(), dispatched);
}

const PlyChunkKernel& plyChunkKernel() {
  static const PlyChunkKernel chosen = chooseKernel(dispatched(), plyChunkKernels);
  return chosen;
}

}  // namespace stipple

#endif  // HWY_ONCE
