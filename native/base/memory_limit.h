#pragma once

#include <cstdint>
#include <string>

namespace stipple {

/// How much memory a piece of work may take; it is refused before it begins.
struct MemoryLimit {
  uint64_t memory_limit_bytes = UINT64_MAX;

  /// Refuses work that needs more than the limit. In: what, as a noun for the message.
  /// Errors: kMemoryLimit.
  void requireMemory(uint64_t bytes, const char* what) const;

  /// Refuses a picture, or its derivative, that needs more than the limit or than this machine has.
  /// In: what, as a noun with its numbers; pair_bytes: of those, for pairs of splat and tile.
  /// Errors: kMemoryLimit.
  void requirePictureMemory(uint64_t bytes, const std::string& what, uint64_t pair_bytes) const;
};

}  // namespace stipple
