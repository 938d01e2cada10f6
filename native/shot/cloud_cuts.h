#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "base/progress.h"
#include "decode/tree/hierarchy_decoder.h"
#include "shot/instances.h"
#include "shot/shutter.h"

namespace stipple {

/// Clouds cut to a share of their splats, which a renderer keeps from one picture to the next.
class CloudCuts {
 public:
  /// In place: each cloud becomes its cut of ceil(share N) nodes of its merge tree. What is not
  /// there yet is made; what is of clouds that nobody else holds any more goes.
  void cut(Instances& instances, double share, Progress* progress);

  /// The same of the clouds of the shutter's steps: which splats are merged is that of the
  /// instance's own cloud, at every step, so that rows stay the same splats. These are not kept.
  void cut(Instances& instances, Shutter& shutter, double share, Progress* progress);

  /// Bytes that `cut` allocates at most, whatever is there already.
  static uint64_t memoryBound(const Instances& instances, double share);
  static uint64_t memoryBound(const Instances& instances, const Shutter& shutter, double share);

 private:
  struct Entry {
    std::shared_ptr<const HierarchyDecoder> hierarchy;                       ///< holds the cloud
    std::vector<std::pair<double, std::shared_ptr<const SplatCloud>>> made;  ///< newest last
  };
  Entry& entryOf(const std::shared_ptr<const SplatCloud>& cloud, Progress* progress);
  std::shared_ptr<const SplatCloud> cutOf(const std::shared_ptr<const SplatCloud>& cloud,
                                          double share, Progress* progress);

  std::mutex mutex_;  ///< of all: a second picture waits for the cut that it would make again
  std::vector<Entry> entries_;
};

}  // namespace stipple
