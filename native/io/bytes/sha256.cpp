// Based on: FIPS 180-4, Secure Hash Standard, sections 4.1.2, 5.1.1 and 6.2.
#include "io/bytes/sha256.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <map>
#include <mutex>
#include <tuple>
#include <vector>

#include "base/error.h"
#include "base/platform/files.h"
#include "io/bytes/input_file.h"

namespace stipple {

namespace {

// The first 32 bits of the fractional parts of the cube roots of the first 64 primes (4.2.2).
constexpr std::array<uint32_t, 64> kRound = {
    0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4, 0xab1c5ed5,
    0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe, 0x9bdc06a7, 0xc19bf174,
    0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f, 0x4a7484aa, 0x5cb0a9dc, 0x76f988da,
    0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7, 0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967,
    0x27b70a85, 0x2e1b2138, 0x4d2c6dfc, 0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85,
    0xa2bfe8a1, 0xa81a664b, 0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070,
    0x19a4c116, 0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3,
    0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7, 0xc67178f2};

constexpr size_t kPiece = size_t{1} << 20;

/// Path, size and time of a file: what its hash is remembered by.
using FileKey = std::tuple<std::string, uint64_t, int64_t>;

class HashMemory {
 public:
  std::string find(const FileKey& key) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto known = hashes_.find(key);
    return known == hashes_.end() ? std::string() : known->second;
  }
  void keep(const FileKey& key, const std::string& hash) {
    const std::lock_guard<std::mutex> lock(mutex_);
    hashes_[key] = hash;
  }

 private:
  std::mutex mutex_;
  std::map<FileKey, std::string> hashes_;
};

HashMemory& hashMemory() {
  static HashMemory memory;
  return memory;
}

int64_t modifiedTime(const std::string& path) {
  platform::PathStatus status;
  return platform::statusOf(path, status) ? status.modified : 0;
}

}  // namespace

void Sha256::addBlock(const uint8_t* bytes) {
  std::array<uint32_t, 64> words;
  for (size_t i = 0; i < 16; ++i) {
    words[i] = uint32_t{bytes[4 * i]} << 24 | uint32_t{bytes[4 * i + 1]} << 16 |
               uint32_t{bytes[4 * i + 2]} << 8 | uint32_t{bytes[4 * i + 3]};
  }
  for (size_t i = 16; i < 64; ++i) {
    const uint32_t a = words[i - 15], b = words[i - 2];
    words[i] = words[i - 16] + (std::rotr(a, 7) ^ std::rotr(a, 18) ^ a >> 3) + words[i - 7] +
               (std::rotr(b, 17) ^ std::rotr(b, 19) ^ b >> 10);
  }
  auto [a, b, c, d, e, f, g, h] = state_;
  for (size_t i = 0; i < 64; ++i) {
    const uint32_t first = h + (std::rotr(e, 6) ^ std::rotr(e, 11) ^ std::rotr(e, 25)) +
                           ((e & f) ^ (~e & g)) + kRound[i] + words[i];
    const uint32_t second =
        (std::rotr(a, 2) ^ std::rotr(a, 13) ^ std::rotr(a, 22)) + ((a & b) ^ (a & c) ^ (b & c));
    h = g;
    g = f;
    f = e;
    e = d + first;
    d = c;
    c = b;
    b = a;
    a = first + second;
  }
  const std::array<uint32_t, 8> worked = {a, b, c, d, e, f, g, h};
  for (size_t i = 0; i < 8; ++i) state_[i] += worked[i];
}

void Sha256::add(const void* bytes, size_t count) {
  const auto* next = static_cast<const uint8_t*>(bytes);
  const size_t held = count_ % kBlock;
  count_ += count;
  if (held != 0) {
    const size_t taken = std::min(count, kBlock - held);
    std::memcpy(rest_.data() + held, next, taken);
    next += taken;
    count -= taken;
    if (held + taken < kBlock) return;
    addBlock(rest_.data());
  }
  for (; count >= kBlock; next += kBlock, count -= kBlock) addBlock(next);
  if (count > 0) std::memcpy(rest_.data(), next, count);
}

std::string Sha256::finish() {
  const uint64_t bits = count_ * 8;
  const uint8_t one = 0x80, zero = 0;
  add(&one, 1);
  while (count_ % kBlock != kBlock - sizeof(bits)) add(&zero, 1);
  std::array<uint8_t, sizeof(bits)> length;
  for (size_t i = 0; i < length.size(); ++i) length[i] = static_cast<uint8_t>(bits >> (56 - 8 * i));
  add(length.data(), length.size());
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const uint32_t word : state_) {
    for (int shift = 28; shift >= 0; shift -= 4) text += kDigits[word >> shift & 15];
  }
  return text;
}

std::string sha256OfFile(const std::string& path, Progress* progress, const char* stage) {
  const InputFile file(path);
  const FileKey key = {path, file.size(), modifiedTime(path)};
  if (std::string known = hashMemory().find(key); !known.empty()) return known;
  Sha256 hash;
  std::vector<uint8_t> piece(kPiece);
  for (uint64_t at = 0; at < file.size();) {
    const auto count = static_cast<size_t>(std::min<uint64_t>(piece.size(), file.size() - at));
    file.readAt(at, piece.data(), count);
    hash.add(piece.data(), count);
    at += count;
    advance(progress, static_cast<double>(at) / static_cast<double>(file.size()), stage);
  }
  const std::string text = hash.finish();
  // A file that was written meanwhile is not remembered.
  if (modifiedTime(path) == std::get<2>(key)) hashMemory().keep(key, text);
  return text;
}

}  // namespace stipple
