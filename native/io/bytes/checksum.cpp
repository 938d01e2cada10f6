// Based on: Yann Collet, xxHash fast digest algorithm, version 0.1.1, section XXH64.
#include "io/bytes/checksum.h"

#include <algorithm>
#include <bit>

#include "io/bytes/little_endian.h"

namespace stipple {

namespace {

constexpr uint64_t kPrime1 = 0x9e3779b185ebca87;
constexpr uint64_t kPrime2 = 0xc2b2ae3d27d4eb4f;
constexpr uint64_t kPrime3 = 0x165667b19e3779f9;
constexpr uint64_t kPrime4 = 0x85ebca77c2b2ae63;
constexpr uint64_t kPrime5 = 0x27d4eb2f165667c5;

uint64_t mixed(uint64_t lane, uint64_t input) {
  return std::rotl(lane + input * kPrime2, 31) * kPrime1;
}

}  // namespace

void Checksum::addStripe(const uint8_t* bytes) {
  for (size_t i = 0; i < lanes_.size(); ++i) {
    lanes_[i] = mixed(lanes_[i], loadLittleEndian<uint64_t>(bytes + 8 * i));
  }
}

void Checksum::add(const void* bytes, size_t count) {
  const auto* next = static_cast<const uint8_t*>(bytes);
  const size_t kept = static_cast<size_t>(count_ % kStripe);
  count_ += count;
  if (kept > 0) {
    const size_t taken = std::min(count, kStripe - kept);
    std::copy_n(next, taken, rest_.begin() + static_cast<std::ptrdiff_t>(kept));
    next += taken;
    count -= taken;
    if (kept + taken < kStripe) return;
    addStripe(rest_.data());
  }
  for (; count >= kStripe; next += kStripe, count -= kStripe) addStripe(next);
  std::copy_n(next, count, rest_.begin());
}

uint64_t Checksum::value() const {
  uint64_t sum = kPrime5;
  if (count_ >= kStripe) {
    constexpr std::array<int, 4> kRotations = {1, 7, 12, 18};
    sum = 0;
    for (size_t i = 0; i < lanes_.size(); ++i) sum += std::rotl(lanes_[i], kRotations[i]);
    for (const uint64_t lane : lanes_) sum = (sum ^ mixed(0, lane)) * kPrime1 + kPrime4;
  }
  sum += count_;
  const uint8_t* next = rest_.data();
  size_t left = static_cast<size_t>(count_ % kStripe);
  for (; left >= 8; next += 8, left -= 8) {
    sum = std::rotl(sum ^ mixed(0, loadLittleEndian<uint64_t>(next)), 27) * kPrime1 + kPrime4;
  }
  if (left >= 4) {
    sum = std::rotl(sum ^ loadLittleEndian<uint32_t>(next) * kPrime1, 23) * kPrime2 + kPrime3;
    next += 4;
    left -= 4;
  }
  for (; left > 0; ++next, --left) sum = std::rotl(sum ^ *next * kPrime5, 11) * kPrime1;
  sum = (sum ^ sum >> 33) * kPrime2;
  sum = (sum ^ sum >> 29) * kPrime3;
  return sum ^ sum >> 32;
}

}  // namespace stipple
