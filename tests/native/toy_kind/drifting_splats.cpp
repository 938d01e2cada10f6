// A kind of model as docs/architecture.md says how to add one: this file, and a row in the table
// (which tests/CMakeLists.txt enters into a copy).
#include "drifting_splats.h"

#include <algorithm>
#include <utility>

#include "density/analytic_density.h"
#include "io/assets/asset_time.h"
#include "io/bytes/safetensors.h"

namespace stipple {

namespace {

/// One splat at each anchor, which moves as time passes.
class DriftDecoder final : public Decoder {
 public:
  DriftDecoder(const RootCube& cube, std::vector<float> metres_per_second, const TimeRange& moving)
      : root(cube), velocity(std::move(metres_per_second)), range(moving) {}

  SplatCloud decode(const DecodeRequest& request) const override {
    const double moved = std::clamp(request.time, range.begin, range.end) - range.begin;
    SplatCloud cloud;
    cloud.resize(request.anchors->size());
    for (size_t i = 0; i < cloud.positions.size(); ++i) {
      const double unit = static_cast<double>(request.anchors->positions[i]);
      const double start = root.origin[i % 3] + root.side * unit;
      cloud.positions[i] = static_cast<float>(start + moved * static_cast<double>(velocity[i % 3]));
    }
    for (size_t i = 0; i < cloud.size(); ++i) cloud.rotations[i * 4] = 1;
    std::fill(cloud.scales.begin(), cloud.scales.end(), 0.01f);
    std::fill(cloud.opacities.begin(), cloud.opacities.end(), 0.5f);
    return cloud;
  }
  uint64_t memoryBound(uint64_t anchor_count, uint32_t) const override { return 56 * anchor_count; }

  RootCube root;
  std::vector<float> velocity;  ///< [3]
  TimeRange range;
};

class DriftingSplats final : public SplatModel {
 public:
  DriftingSplats(std::vector<float> velocity, const TimeRange& range)
      : density_(std::make_shared<const AnalyticDensity>(6, RootCube{{1, 2, 3}, 2})),
        decoder_(density_->root(), std::move(velocity), range) {}

  const char* kind() const override { return "drift"; }
  ModelInfo info() const override {
    ModelInfo info;
    info.leaf_level = density_->leafLevel();
    return info;
  }
  std::shared_ptr<const DensityModel> density() const override { return density_; }
  void save(const std::string& path) const override {
    SafeTensorsWriter file;
    setAssetKind(file, kind());
    file.setMetadata("settings",
                     settingsWithTime("{}", {decoder_.range.begin, decoder_.range.end}));
    file.add("drift.velocity", decoder_.velocity, 3);
    file.write(path);
  }

 protected:
  const Decoder& decoder() const override { return decoder_; }
  void limit(ModelSettings& settings) const override { settings.time = decoder_.range; }

 private:
  std::shared_ptr<const AnalyticDensity> density_;
  DriftDecoder decoder_;
};

}  // namespace

std::shared_ptr<const SplatModel> makeDriftingSplats(std::vector<float> velocity,
                                                     const TimeRange& range) {
  return std::make_shared<const DriftingSplats>(std::move(velocity), range);
}

std::shared_ptr<const SplatModel> readDriftingSplats(const std::string& path, const ReadingAid&) {
  const SafeTensorsReader file(path);
  requireAssetKind(file, "drift");
  const auto time = timeOfSettings(requireText(file, "settings"), path).value_or(AssetTime());
  return makeDriftingSplats(file.readFloats("drift.velocity", 3), {time.begin, time.end});
}

}  // namespace stipple
