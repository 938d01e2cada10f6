#include "model/field_splats.h"

#include <utility>

#include "base/error.h"
#include "decode/field/field_tensors.h"
#include "io/assets/field_asset.h"
#include "model/stored_octree.h"

namespace stipple {

namespace {

class FieldSplats final : public SplatModel {
 public:
  FieldSplats(std::shared_ptr<const OctreeDensity> density,
              std::shared_ptr<const FieldParameters> field, const LearnedDraws& draws,
              ModelNotes notes)
      : density_(std::move(density)),
        decoder_(std::move(field)),
        draws_(draws),
        notes_(std::move(notes)) {}

  const char* kind() const override { return kAssetField; }

  ModelInfo info() const override {
    ModelInfo info;
    info.leaf_level = density_->leafLevel();
    info.leaf_count = density_->leafCount();
    info.sh_degree = decoder_.field().layout.sh_degree;
    const RootCube& root = density_->root();
    for (size_t axis = 0; axis < 3; ++axis) {
      info.bounds_min[axis] = static_cast<float>(root.origin[axis]);
      info.bounds_max[axis] = static_cast<float>(root.origin[axis] + root.side);
    }
    return info;
  }

  std::shared_ptr<const DensityModel> density() const override { return density_; }

  void save(const std::string& path) const override {
    const FieldParameters& field = decoder_.field();
    FieldAsset asset;
    static_cast<OctreeTensors&>(asset) = storedOctree(*density_);
    asset.contracted = field.contracted;
    asset.field_level = field.leaf_level;
    asset.gaussians = field.layout.gaussians;
    asset.sh_degree = field.layout.sh_degree;
    asset.least_anchors = field.least_anchors;
    asset.most_anchors = field.most_anchors;
    asset.jitter = draws_.jitter;
    asset.nested = draws_.nested;
    asset.seed = draws_.seed;
    asset.colour_space = field.colour_space;
    asset.antialias = field.antialias;
    asset.tensors = tensorsOfField(field);
    asset.settings_json = notes_.settings_json;
    asset.extras = notes_.extras;
    writeFieldAsset(asset, path);
  }

 protected:
  const Decoder& decoder() const override { return decoder_; }
  LearnedDraws draws() const override { return draws_; }

  void limit(ModelSettings& settings) const override {
    const FieldParameters& field = decoder_.field();
    settings.has_order = !draws_.nested;
    settings.default_budget = field.most_anchors;
    settings.minimum_learned_budget = field.least_anchors;
    settings.maximum_learned_budget = field.most_anchors;
    settings.minimum_gaussians_per_anchor = field.layout.gaussians;
    settings.maximum_gaussians_per_anchor = field.layout.gaussians;
    settings.default_gaussians_per_anchor = field.layout.gaussians;
  }

 private:
  std::shared_ptr<const OctreeDensity> density_;
  FieldDecoder decoder_;
  LearnedDraws draws_;
  ModelNotes notes_;
};

}  // namespace

std::shared_ptr<const SplatModel> makeFieldSplats(std::shared_ptr<const OctreeDensity> density,
                                                  std::shared_ptr<const FieldParameters> field,
                                                  const LearnedDraws& draws, ModelNotes notes) {
  return std::make_shared<const FieldSplats>(std::move(density), std::move(field), draws,
                                             std::move(notes));
}

std::shared_ptr<const SplatModel> readFieldSplats(const std::string& path, const ReadingAid&) {
  FieldAsset asset = readFieldAsset(path);
  ModelNotes notes = {std::move(asset.settings_json), std::move(asset.extras)};
  FieldParameters like;
  like.root = {asset.root_origin, asset.root_side};
  like.contracted = asset.contracted;
  like.leaf_level = asset.field_level;
  like.layout = {asset.gaussians, asset.sh_degree};
  like.least_anchors = asset.least_anchors;
  like.most_anchors = asset.most_anchors;
  like.colour_space = asset.colour_space;
  like.antialias = asset.antialias;
  const LearnedDraws draws = {asset.jitter, asset.nested, asset.seed};
  try {
    std::shared_ptr<const OctreeDensity> density = octreeFromStored(asset);
    auto field = std::make_shared<const FieldParameters>(fieldOfTensors(asset.tensors, like));
    return makeFieldSplats(std::move(density), std::move(field), draws, std::move(notes));
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, path + ": " + error.what());
  }
}

}  // namespace stipple
