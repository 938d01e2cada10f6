#include "model/hierarchy_splats.h"

#include <utility>

#include "base/error.h"
#include "data/position_bounds.h"
#include "decode/tree/masked_tree.h"
#include "io/assets/hierarchy_asset.h"

namespace stipple {

namespace {

class HierarchySplats final : public SplatModel {
 public:
  HierarchySplats(std::shared_ptr<const HierarchyDecoder> hierarchy, ModelNotes notes)
      : hierarchy_(std::move(hierarchy)), notes_(std::move(notes)) {}

  const char* kind() const override { return kAssetHierarchy; }

  ModelInfo info() const override {
    const SplatCloud& leaves = *hierarchy_->leaves();
    ModelInfo info;
    info.leaf_count = leaves.size();
    info.sh_degree = leaves.sh_degree;
    fillBounds(leaves.positions, info.bounds_min.data(), info.bounds_max.data());
    return info;
  }

  void save(const std::string& path) const override {
    HierarchyAsset asset;
    asset.settings_json = notes_.settings_json;
    asset.extras = notes_.extras;
    asset.leaves = *hierarchy_->leaves();
    asset.nodes = hierarchy_->tree()->nodes;
    asset.parents = hierarchy_->tree()->parents;
    asset.errors = hierarchy_->tree()->errors;
    writeHierarchyAsset(asset, path);
  }

  std::shared_ptr<const SplatModel> keep(std::span<const uint8_t> mask) const override {
    MaskedTree masked = maskedTree(*hierarchy_->leaves(), *hierarchy_->tree(), mask);
    return makeHierarchySplats(std::make_shared<const HierarchyDecoder>(
        std::make_shared<const SplatCloud>(std::move(masked.leaves)),
        std::make_shared<const MergeTree>(std::move(masked.tree))));
  }

  uint64_t keepMemoryBound() const override {
    const SplatCloud& leaves = *hierarchy_->leaves();
    return 2 * mergeTreeMemoryBound(leaves.size(), leaves.sh_degree);
  }

 protected:
  const Decoder& decoder() const override { return *hierarchy_; }

  void limit(ModelSettings& settings) const override {
    settings.maximum_budget = settings.default_budget = hierarchy_->leaves()->size();
  }

 private:
  std::shared_ptr<const HierarchyDecoder> hierarchy_;
  ModelNotes notes_;
};

}  // namespace

std::shared_ptr<const SplatModel> makeHierarchySplats(
    std::shared_ptr<const HierarchyDecoder> hierarchy, ModelNotes notes) {
  return std::make_shared<const HierarchySplats>(std::move(hierarchy), std::move(notes));
}

std::shared_ptr<const SplatModel> readHierarchySplats(const std::string& path, const ReadingAid&) {
  HierarchyAsset asset = readHierarchyAsset(path);
  ModelNotes notes = {std::move(asset.settings_json), std::move(asset.extras)};
  auto leaves = std::make_shared<const SplatCloud>(std::move(asset.leaves));
  auto tree = std::make_shared<MergeTree>();
  tree->nodes = std::move(asset.nodes);
  tree->parents = std::move(asset.parents);
  tree->errors = std::move(asset.errors);
  try {
    return makeHierarchySplats(
        std::make_shared<const HierarchyDecoder>(std::move(leaves), std::move(tree)),
        std::move(notes));
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, path + ": " + error.what());
  }
}

}  // namespace stipple
