#include "model/scaffold_splats.h"

#include <cmath>
#include <utility>

#include "base/error.h"
#include "data/position_bounds.h"
#include "decode/anchors/scaffold_decoder.h"
#include "decode/anchors/scaffold_tensors.h"
#include "io/assets/scaffold_asset.h"

namespace stipple {

namespace {

class ScaffoldSplats final : public SplatModel {
 public:
  ScaffoldSplats(std::shared_ptr<const ScaffoldParameters> scaffold, ModelNotes notes)
      : decoder_(std::move(scaffold)), notes_(std::move(notes)) {}

  const char* kind() const override { return kAssetScaffold; }

  ModelInfo info() const override {
    const ScaffoldParameters& scaffold = decoder_.scaffold();
    ModelInfo info;
    info.leaf_count = scaffold.size();
    info.sh_degree = scaffold.sh_degree;
    fillBounds(scaffold.positions, info.bounds_min.data(), info.bounds_max.data());
    return info;
  }

  void save(const std::string& path) const override {
    const ScaffoldParameters& scaffold = decoder_.scaffold();
    ScaffoldAsset asset;
    asset.gaussians = scaffold.gaussians;
    asset.sh_degree = scaffold.sh_degree;
    asset.colour_space = scaffold.colour_space;
    asset.antialias = scaffold.antialias;
    asset.coarsening_percent = static_cast<uint32_t>(std::lround(100 * scaffold.coarsening));
    asset.tensors = tensorsOfScaffold(scaffold);
    asset.settings_json = notes_.settings_json;
    asset.extras = notes_.extras;
    writeScaffoldAsset(asset, path);
  }

 protected:
  const Decoder& decoder() const override { return decoder_; }

  void limit(ModelSettings& settings) const override {
    const ScaffoldParameters& scaffold = decoder_.scaffold();
    settings.maximum_budget = settings.default_budget = scaffold.size();
    settings.minimum_gaussians_per_anchor = scaffold.gaussians;
    settings.maximum_gaussians_per_anchor = scaffold.gaussians;
    settings.default_gaussians_per_anchor = scaffold.gaussians;
  }

 private:
  ScaffoldDecoder decoder_;
  ModelNotes notes_;
};

}  // namespace

std::shared_ptr<const SplatModel> makeScaffoldSplats(
    std::shared_ptr<const ScaffoldParameters> scaffold, ModelNotes notes) {
  if (scaffold->size() == 0) {
    fail(ErrorCode::kInvalidArgument, "there are 0 anchors; at least 1 is needed");
  }
  return std::make_shared<const ScaffoldSplats>(std::move(scaffold), std::move(notes));
}

std::shared_ptr<const SplatModel> readScaffoldSplats(const std::string& path, const ReadingAid&) {
  ScaffoldAsset asset = readScaffoldAsset(path);
  ModelNotes notes = {std::move(asset.settings_json), std::move(asset.extras)};
  const ScaffoldShape shape = {asset.gaussians,
                               asset.sh_degree,
                               asset.colour_space,
                               asset.antialias,
                               0,
                               asset.coarsening_percent / 100.0};
  try {
    return makeScaffoldSplats(
        std::make_shared<const ScaffoldParameters>(scaffoldOfTensors(asset.tensors, shape)),
        std::move(notes));
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, path + ": " + error.what());
  }
}

}  // namespace stipple
