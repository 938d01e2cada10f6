#pragma once

#include <cstdint>
#include <string>

#include "byte_text.h"

namespace stipple {

/// A .ksplat file put together from the description of the format: two sections of two splats and
/// one.
struct RawKsplat {
  unsigned level = 0;
  unsigned degree = 0;
  uint64_t count = 3;
  uint64_t sections = 2;
  uint64_t full = 1, partial = 1, buckets = 2, length = 1;
  float low = 0, high = 0;

  /// Splat number n: the numbers of its row are simple, and different for each.
  ByteText row(unsigned n) const {
    ByteText bytes;
    if (level == 0) {
      bytes.f32(1.0f + static_cast<float>(n)).f32(2).f32(-3);
      bytes.f32(0.5f).f32(0.25f).f32(0.125f).f32(0).f32(3).f32(0).f32(4);
    } else {
      bytes.u16(32767 + 100 * n).u16(0).u16(65534);
      bytes.u16(0x3800).u16(0x3400).u16(0x3000).u16(0).u16(0x4200).u16(0).u16(0x4400);
    }
    bytes.u8(0).u8(255).u8(51).u8(102);
    const unsigned numbers = degree == 0 ? 0 : degree == 1 ? 9 : degree == 2 ? 24 : 45;
    for (unsigned k = 0; k < numbers; ++k) {
      if (level == 0) bytes.f32(static_cast<float>(k));
      if (level == 1) bytes.u16(0x3c00 + k);
      if (level == 2) bytes.u8(k * 5);
    }
    return bytes;
  }

  std::string sectionHeader(uint64_t splats, uint64_t room, uint64_t full_buckets,
                            uint64_t partial_buckets, uint64_t bucket_count) const {
    ByteText header;
    header.u32(splats).u32(room).u32(2).u32(bucket_count).f32(8).u16(12).u16(0).u32(32767).u32(0);
    header.u32(full_buckets).u32(partial_buckets).u16(degree);
    return header.zeros(1024 - header.bytes.size()).bytes;
  }

  std::string bytes() const {
    ByteText file;
    file.u8(0).u8(1).u16(0).u32(sections).u32(sections).u32(count).u32(count).u16(level).u16(0);
    file.f32(0).f32(0).f32(0).f32(low).f32(high);
    file.zeros(4096 - file.bytes.size());
    // The first section: one full bucket of two, and one bucket of one splat with room for one
    // more.
    file.text(sectionHeader(3, 4, full, partial, buckets));
    for (uint64_t s = 1; s < sections && s < 3; ++s) file.text(sectionHeader(0, 0, 0, 0, 0));
    for (uint64_t p = 0; p < partial; ++p) file.u32(length);
    for (uint64_t b = 0; b < buckets; ++b) file.f32(10.0f * static_cast<float>(b)).f32(20).f32(30);
    for (unsigned n = 0; n < 4; ++n) file.text(row(n).bytes);
    return file.bytes;
  }
};

}  // namespace stipple
