#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace stipple {

/// XXH64 with seed 0 of bytes that are added piece by piece: finds damage, not malice.
class Checksum {
 public:
  void add(const void* bytes, size_t count);
  uint64_t value() const;

 private:
  static constexpr size_t kStripe = 32;

  void addStripe(const uint8_t* bytes);

  std::array<uint64_t, 4> lanes_ = {0x60ea27eeadc0b5d6, 0xc2b2ae3d27d4eb4f, 0, 0x61c8864e7a143579};
  std::array<uint8_t, kStripe> rest_ = {};  ///< of an incomplete stripe
  uint64_t count_ = 0;
};

}  // namespace stipple
