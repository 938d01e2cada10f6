#include "train/networks/gradient_exchange.h"

#include <algorithm>
#include <array>
#include <bit>
#include <string>

#include "base/error.h"
#include "base/random.h"

namespace stipple {

namespace {

class NoExchange final : public GradientExchange {
 public:
  size_t rank() const override { return 0; }
  size_t size() const override { return 1; }
  void sum(std::span<float>) override {}
  void sum(std::span<double>) override {}
  void share(std::span<float>) override {}
};

}  // namespace

std::shared_ptr<GradientExchange> noExchange() {
  return std::make_shared<NoExchange>();
}

uint64_t fingerprintOf(std::span<const float> values) {
  // FNV-1a by words instead of bytes, in lanes that do not wait for each other.
  constexpr uint64_t kBasis = 0xcbf29ce484222325ull, kPrime = 0x100000001b3ull;
  std::array<uint64_t, 4> lanes = {kBasis, kBasis, kBasis, kBasis};
  for (size_t first = 0; first < values.size(); first += lanes.size()) {
    const size_t count = std::min(lanes.size(), values.size() - first);
    for (size_t lane = 0; lane < count; ++lane) {
      lanes[lane] = (lanes[lane] ^ std::bit_cast<uint32_t>(values[first + lane])) * kPrime;
    }
  }
  uint64_t bits = values.size();
  for (const uint64_t lane : lanes) bits = mixBits(bits ^ lane);
  return bits;
}

void requireSame(GradientExchange& exchange, uint64_t fingerprint, const char* what) {
  if (exchange.size() == 1) return;
  // Sums of 32 bits are exact. Where all ranks have the mean of all, all have the same.
  const auto own = static_cast<double>(fingerprint >> 32);
  double all = own;
  exchange.sum({&all, 1});
  if (all == own * static_cast<double>(exchange.size())) return;
  fail(ErrorCode::kInvalidArgument,
       std::string(what) + " of the " + std::to_string(exchange.size()) +
           " processes differ; they have to be the same on all machines");
}

void requireExamples(const GradientExchange& exchange, size_t batch, const char* part) {
  if (batch >= exchange.size()) return;
  fail(ErrorCode::kInvalidArgument, std::string("the number of objects in a step of ") + part +
                                        " is " + std::to_string(batch) + ", and " +
                                        std::to_string(exchange.size()) +
                                        " processes share them; at least one for each is needed");
}

std::vector<size_t> ownExamples(const GradientExchange& exchange, size_t batch) {
  std::vector<size_t> own;
  for (size_t b = exchange.rank(); b < batch; b += exchange.size()) own.push_back(b);
  return own;
}

void sumStep(GradientExchange& exchange, std::span<const float> weights, std::span<float> gradients,
             std::span<double> losses) {
  if (exchange.size() == 1) return;
  requireSame(exchange, fingerprintOf(weights), "the weights");
  exchange.sum(gradients);
  exchange.sum(losses);
}

}  // namespace stipple
