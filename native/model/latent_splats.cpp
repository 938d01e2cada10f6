#include "model/latent_splats.h"

#include <algorithm>
#include <map>
#include <utility>

#include "base/error.h"
#include "decode/latent/latent_decoder.h"
#include "decode/latent/latent_density.h"
#include "io/assets/latent_asset.h"
#include "io/assets/weight_file.h"

namespace stipple {

namespace {

/// Splats that are of use: fewer show nothing, more only repeat what the network says.
constexpr uint64_t kLeastSplats = 1000;
constexpr uint64_t kMostSplats = 1000000;

class LatentSplats final : public SplatModel {
 public:
  LatentSplats(const LatentNetworks& networks, std::shared_ptr<const Latent> latent,
               WeightsReference weights, ModelNotes notes, const NetworkRun& run)
      : latent_(latent),
        density_(std::make_shared<const LatentDensity>(networks.octree, latent, run,
                                                       networks.range.leaf_level)),
        decoder_(networks.gaussians, latent, run),
        weights_(std::move(weights)),
        notes_(std::move(notes)),
        range_(networks.range) {}

  const char* kind() const override { return kAssetLatent; }

  ModelInfo info() const override {
    ModelInfo info;
    info.leaf_level = density_->leafLevel();
    const RootCube& root = density_->root();
    for (size_t axis = 0; axis < 3; ++axis) {
      info.bounds_min[axis] = static_cast<float>(root.origin[axis]);
      info.bounds_max[axis] = static_cast<float>(root.origin[axis] + root.side);
    }
    return info;
  }

  std::shared_ptr<const DensityModel> density() const override { return density_; }

  void save(const std::string& path) const override {
    LatentAsset asset;
    asset.latent = *latent_;
    asset.weights = weights_;
    asset.settings_json = notes_.settings_json;
    asset.extras = notes_.extras;
    writeLatentAsset(asset, path);
  }

 protected:
  const Decoder& decoder() const override { return decoder_; }

  void limit(ModelSettings& settings) const override {
    const uint32_t gaussians = decoder_.network().gaussians();
    settings.minimum_budget =
        std::min(range_.least_anchors, (kLeastSplats + gaussians - 1) / gaussians);
    settings.maximum_budget = kMostSplats / gaussians;
    // The time grows with the square of the budget.
    settings.default_budget =
        std::clamp(range_.usual_anchors, settings.minimum_budget, settings.maximum_budget);
    settings.minimum_learned_budget = range_.least_anchors;
    settings.maximum_learned_budget = range_.most_anchors;
    settings.minimum_gaussians_per_anchor = gaussians;
    settings.maximum_gaussians_per_anchor = gaussians;
    settings.default_gaussians_per_anchor = gaussians;
  }

 private:
  std::shared_ptr<const Latent> latent_;
  std::shared_ptr<const LatentDensity> density_;
  LatentDecoder decoder_;
  WeightsReference weights_;
  ModelNotes notes_;
  LatentRange range_;
};

}  // namespace

LatentNetworks openLatentNetworks(const std::string& path) {
  std::map<std::string, std::string> metadata;
  LatentNetworks networks = readLatentNetworks(openWeightFile(path, &metadata));
  networks.range = latentRangeOf(metadata, path);
  return networks;
}

std::shared_ptr<const SplatModel> makeLatentSplats(const LatentNetworks& networks,
                                                   std::shared_ptr<const Latent> latent,
                                                   WeightsReference weights, ModelNotes notes,
                                                   const NetworkRun& run) {
  return std::make_shared<const LatentSplats>(networks, std::move(latent), std::move(weights),
                                              std::move(notes), run);
}

std::shared_ptr<const SplatModel> readLatentSplats(const std::string& path, const ReadingAid& aid) {
  LatentAsset asset = readLatentAsset(path);
  const std::string weights = findReferenced(asset.weights, aid.weights_folders, path, aid.progress);
  const LatentNetworks networks = openLatentNetworks(weights);
  ModelNotes notes = {std::move(asset.settings_json), std::move(asset.extras)};
  try {
    return makeLatentSplats(networks, std::make_shared<const Latent>(std::move(asset.latent)),
                            std::move(asset.weights), std::move(notes));
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, path + ": " + error.what());
  }
}

}  // namespace stipple
