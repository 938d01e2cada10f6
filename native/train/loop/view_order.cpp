#include "train/loop/view_order.h"

#include <numeric>
#include <utility>

#include "base/random.h"

namespace stipple {

ViewOrder::ViewOrder(size_t count, uint64_t seed) : order_(count), seed_(seed) {}

size_t ViewOrder::at(uint64_t iteration) {
  const uint64_t round = iteration / order_.size();
  if (round != round_) {
    std::iota(order_.begin(), order_.end(), 0u);
    // Fisher and Yates; the modulus favours nothing that anybody could see, counts being far below
    // 2^64.
    for (size_t i = order_.size(); i > 1; --i) {
      const uint64_t bits = keyedBits(seed_, RandomUse::kViewOrder, round * order_.size() + i);
      std::swap(order_[i - 1], order_[bits % i]);
    }
    round_ = round;
  }
  return order_[iteration % order_.size()];
}

}  // namespace stipple
