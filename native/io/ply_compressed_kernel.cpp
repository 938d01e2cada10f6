// Bits of a compressed PLY to float32, in lanes. The scalar loops say what is computed; lanes do
// the same operations in the same order.
#include "io/ply_compressed_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "io/ply_compressed_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

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

PlyChunkKernel chunkKernel() {
  return {hwy::TargetName(HWY_TARGET), decode, decodeHarmonics};
}

#endif  // HWY_TARGET == HWY_SCALAR

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "base/kernel_choice.h"
#include "io/every_target.h"

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
