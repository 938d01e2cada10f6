#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "data/clouds/cloud_bytes.h"
#include "data/clouds/splat_cloud.h"

namespace stipple {

/// validate() piece by piece, by a writer that has the values in the cache anyway: one pass through
/// memory less. The file must not be committed before require().
class RowCheck {
 public:
  /// Refuses arrays that disagree in size.
  RowCheck(const SplatCloud& cloud, const char* what);
  /// Notes and tells whether rows [begin, end) are valid; from any thread. Others are not to be
  /// encoded: conversions of NaN to whole numbers are undefined.
  bool look(size_t begin, size_t end);
  /// Notes that some row is not valid, where look() has not been asked; from any thread.
  void doubt() { valid_.store(false, std::memory_order_relaxed); }
  /// Refuses the cloud as validate() does if one of the rows was not valid.
  void require() const;

 private:
  const SplatCloud& cloud_;
  const char* what_;
  std::atomic<bool> valid_{true};
};

/// Refuses a count of splats that is more than a file of so many bytes may have, before they are
/// allocated. In: name, of the file. Errors: kFormat with both numbers.
void requireAllowedSplats(uint64_t count, int sh_degree, uint64_t file_bytes,
                          const std::string& name);

/// Refuses a cloud with values that no splat can have, as a fault of the file that it was read
/// from. Errors: kFormat with the file, the splat, the value seen and what is allowed.
void requireValidSplats(const SplatCloud& cloud, const std::string& path);

}  // namespace stipple
