#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace stipple {

/// How much memory a piece of work may take; it is refused before it begins.
struct MemoryLimit {
  uint64_t memory_limit_bytes = UINT64_MAX;

  /// 60 % of the machine's memory: the rest is for the program around the library and for the
  /// system. UINT64_MAX where the system does not tell.
  static uint64_t ofThisMachine();

  /// Refuses work that needs more than the limit. In: what, as a noun for the message.
  /// Errors: kMemoryLimit.
  void requireMemory(uint64_t bytes, const char* what) const;

  /// Refuses a budget that needs more than the limit, with the largest that fits.
  /// In: unit, what is counted, in the plural; bytes_of, bytes that a budget needs, which never fall
  /// where the budget rises. Errors: kMemoryLimit.
  void requireBudget(uint64_t budget, const char* unit,
                     const std::function<uint64_t(uint64_t)>& bytes_of) const;

  /// Refuses a picture, or its derivative, that needs more than the limit or than this machine has.
  /// In: what, as a noun with its numbers; pair_bytes: of those, for pairs of splat and tile.
  /// Errors: kMemoryLimit.
  void requirePictureMemory(uint64_t bytes, const std::string& what, uint64_t pair_bytes) const;
};

}  // namespace stipple
