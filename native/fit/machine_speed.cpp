#include "fit/machine_speed.h"

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/stopwatch.h"
#include "data/weight_table.h"
#include "nn/attention.h"
#include "nn/linear.h"
#include "nn/network_run.h"

namespace stipple {

namespace {

constexpr double kSeconds = 0.08;  // of each measurement: as long as a small layer

/// Runs `work` for a while, once before to warm caches up. Returns operations a second.
template <typename Work>
double measured(double operations, const Work& work) {
  work();
  const Stopwatch watch;
  double done = 0;
  do {
    work();
    done += operations;
  } while (watch.seconds() < kSeconds);
  return done / watch.seconds();
}

double productSpeed() {
  constexpr size_t kRows = 512, kWidth = 1024;
  // Values near 1: numbers close to 0 would be slower than those of networks.
  auto numbers = std::make_shared<const std::vector<float>>(kWidth * kWidth, 0.5f);
  WeightTensor weight;
  weight.type = WeightType::kFloat32;
  weight.type_name = "F32";
  weight.shape = {kWidth, kWidth};
  weight.bytes = reinterpret_cast<const uint8_t*>(numbers->data());
  const WeightTable table("a measurement", {{"layer.weight", weight}}, numbers);
  const Linear layer(table, "layer", kWidth, kWidth, LinearBias::kNone);
  const std::vector<float> in(kRows * kWidth, 0.5f);
  std::vector<float> out(in.size());
  return measured(2.0 * kRows * kWidth * kWidth,
                  [&] { layer.apply({}, kRows, in.data(), out.data()); });
}

double attentionSpeed() {
  constexpr size_t kQueries = 256, kKeys = 1024, kHeads = 16, kHeadWidth = 64;
  constexpr size_t kWidth = kHeads * kHeadWidth;
  const std::vector<float> q(kQueries * kWidth, 0.5f), k(kKeys * kWidth, 0.5f);
  std::vector<float> out(q.size());
  const AttentionShape shape = {kHeads, kHeadWidth, kQueries, kKeys};
  return measured(4.0 * kQueries * kKeys * kWidth, [&] {
    attention({}, shape, {q.data(), kWidth}, {k.data(), kWidth}, {k.data(), kWidth}, out.data(),
              kWidth);
  });
}

}  // namespace

const MachineSpeed& machineSpeed() {
  static const MachineSpeed speed = {productSpeed(), attentionSpeed()};
  return speed;
}

}  // namespace stipple
