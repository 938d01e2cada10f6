#include "network_golden/recorded_splats.h"

#include <cmath>
#include <span>

#include "math/morton.h"

namespace stipple {

namespace {

int leafLevel(const GoldenFile& file) {
  return file.config().at("level").get<int>();
}

}  // namespace

std::vector<double> recordedUniforms(const GoldenFile& file) {
  std::vector<double> numbers;
  for (int level = 1; level <= leafLevel(file); ++level) {
    for (const float u : file.floats("input.uniform.level" + std::to_string(level))) {
      numbers.push_back(static_cast<double>(u));
    }
  }
  for (const float u : file.floats("input.jitter")) numbers.push_back(static_cast<double>(u));
  return numbers;
}

std::vector<int64_t> recordedLeaves(const GoldenFile& file) {
  const std::vector<float> points = file.floats("expect.points");
  std::vector<int64_t> leaves;
  for (size_t i = 0; i < points.size(); i += 3) {
    const auto at = [&](size_t axis) {
      return static_cast<uint32_t>(std::floor(std::ldexp(points[i + axis], leafLevel(file))));
    };
    leaves.push_back(static_cast<int64_t>(mortonEncode(at(0), at(1), at(2))));
  }
  return leaves;
}

AnchorSet recordedAnchors(const GoldenFile& file) {
  AnchorSet anchors;
  const std::vector<float> points = file.floats("expect.points");
  const std::vector<float> log_q = file.floats("expect.log_probs");
  anchors.positions.assign(points.begin(), points.end());
  anchors.log_q.assign(log_q.begin(), log_q.end());
  for (const int64_t leaf : recordedLeaves(file)) {
    anchors.leaves.push_back(static_cast<uint64_t>(leaf));
  }
  return anchors;
}

void compareSplats(const std::string& stem, const GoldenFile& file, const SplatCloud& cloud,
                   StageTolerance tolerance, StageReport& report) {
  const auto compare = [&](const char* name, std::span<const float> seen) {
    const std::string whole = std::string("gaussians.") + name;
    report.compare(stem + whole, seen, file.floats("expect." + whole), tolerance);
  };
  compare("position", cloud.positions);
  compare("scale", cloud.scales);
  compare("opacity", cloud.opacities);
  compare("rotation_wxyz", cloud.rotations);
  compare("sh_dc", cloud.sh);
}

}  // namespace stipple
