// What matrix products of this library reach on this machine, and how many operations a decode of
// the published networks has.
//
//   full_size_rate SECONDS [TOKENS ANCHORS]...
//
// Multiplies 4096 rows of 1024 numbers with a layer of 4096 outputs, as in the MLPs of the flow
// network, for about so many seconds, and prints JSON.

#include <cstdio>
#include <cstdlib>
#include <vector>

#include "base/parallel.h"
#include "generate/flow_cost.h"
#include "nn/linear.h"
#include "nn/matrix_backend.h"
#include "peers/full_size_clock.h"
#include "peers/full_size_files.h"

namespace stipple {
namespace {

/// Operations a second.
double productRate(double wanted_seconds) {
  constexpr size_t kRows = 4096, kInputs = 1024, kOutputs = 4096;
  WeightShapes shapes;
  addLayerShapes(shapes, "layer", {kOutputs, kInputs});
  const Linear layer(sharedWeights(shapes), "layer", kInputs, kOutputs);
  std::vector<float> in(kRows * kInputs), out(kRows * kOutputs);
  for (size_t i = 0; i < in.size(); ++i) in[i] = 0.5f + 0.001f * static_cast<float>(i % 977);
  layer.apply({}, kRows, in.data(), out.data());
  const double begin = seconds();
  double operations = 0;
  while (seconds() - begin < wanted_seconds) {
    layer.apply({}, kRows, in.data(), out.data());
    operations += 2.0 * kRows * kInputs * kOutputs;
  }
  return operations / (seconds() - begin);
}

}  // namespace
}  // namespace stipple

int main(int count, char** arguments) {
  using namespace stipple;
  if (count < 2 || count % 2 != 0) {
    std::fprintf(stderr, "full_size_rate SECONDS [TOKENS ANCHORS]...\n");
    return 2;
  }
  std::printf(
      "{\"backend\": \"%s\", \"instruction_sets\": \"%s\", \"threads\": %zu, \"rate\": %.6g, "
      "\"decodes\": [",
      defaultMatrixBackend().name(), defaultMatrixBackend().instructionSets().c_str(),
      threadLimit(), productRate(std::atof(arguments[1])));
  for (int i = 2; i < count; i += 2) {
    const uint64_t tokens = std::strtoull(arguments[i], nullptr, 10);
    const uint64_t anchors = std::strtoull(arguments[i + 1], nullptr, 10);
    std::printf("%s{\"levels\": %.6g, \"splats\": %.6g}", i == 2 ? "" : ", ",
                octreeCost(anchors, tokens).flops, splatDecoderCost(anchors, tokens).flops);
  }
  std::printf("]}\n");
  return 0;
}
