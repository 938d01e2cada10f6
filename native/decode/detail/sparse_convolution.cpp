#include "decode/detail/sparse_convolution.h"

#include <algorithm>
#include <unordered_map>

#include "nn/matmul.h"
#include "nn/training/column_sums.h"

namespace stipple {

namespace {

constexpr size_t kCentre = 13;
constexpr int kBits = 21;

/// Of a cell that may be one below 0.
uint64_t keyOf(int64_t x, int64_t y, int64_t z) {
  const auto part = [](int64_t at) { return static_cast<uint64_t>(at + 1); };
  return part(x) | part(y) << kBits | part(z) << 2 * kBits;
}

std::vector<float> gathered(std::span<const uint32_t> rows, size_t width, const float* from) {
  std::vector<float> made(rows.size() * width);
  for (size_t i = 0; i < rows.size(); ++i) {
    std::copy_n(from + rows[i] * width, width, &made[i * width]);
  }
  return made;
}

void scatter(std::span<const uint32_t> rows, size_t width, const std::vector<float>& from,
             float* to) {
  for (size_t i = 0; i < rows.size(); ++i) {
    for (size_t c = 0; c < width; ++c) to[rows[i] * width + c] += from[i * width + c];
  }
}

}  // namespace

CellNeighbours::CellNeighbours(const PointCells& cells) : count_(cells.cells.size()) {
  std::unordered_map<uint64_t, uint32_t> first;
  first.reserve(count_);
  for (uint32_t i = 0; i < count_; ++i) {
    const auto& [x, y, z] = cells.cells[i];
    first.emplace(keyOf(x, y, z), i);  // The first that lies there stays.
  }
  for (size_t tap = 0; tap < kCellTaps; ++tap) {
    const auto dx = static_cast<int64_t>(tap / 9) - 1, dy = static_cast<int64_t>(tap / 3 % 3) - 1,
               dz = static_cast<int64_t>(tap % 3) - 1;
    for (uint32_t i = 0; i < count_; ++i) {
      const auto& [x, y, z] = cells.cells[i];
      const auto found = first.find(keyOf(x + dx, y + dy, z + dz));
      if (found == first.end()) continue;
      pairs_[tap].points.push_back(i);
      pairs_[tap].neighbours.push_back(tap == kCentre ? i : found->second);
    }
  }
}

SparseConvolution::SparseConvolution(ParameterLayout& layout, const std::string& name,
                                     size_t inputs, size_t outputs)
    : inputs_(inputs),
      outputs_(outputs),
      weight_(layout.add(name + ".weight", {outputs, 3, 3, 3, inputs})),
      bias_(layout.add(name + ".bias", {outputs})) {}

void SparseConvolution::apply(std::span<const float> values, const CellNeighbours& neighbours,
                              const float* in, float* out) const {
  for (size_t i = 0; i < neighbours.count(); ++i) {
    std::copy_n(values.data() + bias_, outputs_, out + i * outputs_);
  }
  std::vector<float> turned(inputs_ * outputs_);
  for (size_t tap = 0; tap < kCellTaps; ++tap) {
    const CellNeighbours::Pairs& pairs = neighbours.pairs(tap);
    if (pairs.points.empty()) continue;
    const std::vector<float> rows = gathered(pairs.neighbours, inputs_, in);
    const float* weight = tapOf(values, tap);
    for (size_t o = 0; o < outputs_; ++o) {
      for (size_t i = 0; i < inputs_; ++i) {
        turned[i * outputs_ + o] = weight[o * kCellTaps * inputs_ + i];
      }
    }
    std::vector<float> made(pairs.points.size() * outputs_);
    multiply({pairs.points.size(), inputs_, outputs_}, {rows.data(), inputs_},
             {turned.data(), outputs_}, {made.data(), outputs_});
    scatter(pairs.points, outputs_, made, out);
  }
}

void SparseConvolution::backward(std::span<const float> values, const CellNeighbours& neighbours,
                                 const float* in, const float* out_gradient,
                                 std::span<float> gradients, float* in_gradient) const {
  std::vector<float> by_weight(inputs_ * outputs_);
  for (size_t tap = 0; tap < kCellTaps; ++tap) {
    const CellNeighbours::Pairs& pairs = neighbours.pairs(tap);
    const size_t count = pairs.points.size();
    if (count == 0) continue;
    const std::vector<float> rows = gathered(pairs.neighbours, inputs_, in);
    const std::vector<float> outer = gathered(pairs.points, outputs_, out_gradient);
    multiply({outputs_, count, inputs_}, {outer.data(), 1, outputs_}, {rows.data(), inputs_},
             {by_weight.data(), inputs_});
    float* gradient = gradients.data() + weight_ + tap * inputs_;
    for (size_t o = 0; o < outputs_; ++o) {
      for (size_t i = 0; i < inputs_; ++i) {
        gradient[o * kCellTaps * inputs_ + i] += by_weight[o * inputs_ + i];
      }
    }
    std::vector<float> by_rows(count * inputs_);
    multiply({count, outputs_, inputs_}, {outer.data(), outputs_},
             {tapOf(values, tap), kCellTaps * inputs_}, {by_rows.data(), inputs_});
    scatter(pairs.neighbours, inputs_, by_rows, in_gradient);
  }
  addColumnSums(
      neighbours.count(), outputs_,
      [&](size_t row, double* part) {
        for (size_t o = 0; o < outputs_; ++o) {
          part[o] += static_cast<double>(out_gradient[row * outputs_ + o]);
        }
      },
      gradients.data() + bias_);
}

}  // namespace stipple
