#include "api/field.h"

#include <memory>
#include <utility>

#include "base/error.h"
#include "decode/field/field_tensors.h"
#include "io/assets/field_asset.h"

namespace stipple::api {

OctreeTensors octreeOf(const OctreeDensity& density) {
  OctreeTensors octree;
  octree.root_origin = density.root().origin;
  octree.root_side = density.root().side;
  for (int level = 0; level < density.leafLevel(); ++level) {
    const auto cells = density.cells(level);
    const auto log_probabilities = density.logProbabilities(level);
    octree.cells.emplace_back(cells.begin(), cells.end());
    octree.log_probabilities.emplace_back(log_probabilities.begin(), log_probabilities.end());
  }
  return octree;
}

ModelParts loadField(const std::string& path) {
  FieldAsset asset = readFieldAsset(path);
  auto notes = std::make_shared<const ModelNotes>(
      ModelNotes{std::move(asset.settings_json), std::move(asset.extras)});
  const RootCube root = {asset.root_origin, asset.root_side};
  FieldParameters like;
  like.root = root;
  like.contracted = asset.contracted;
  like.leaf_level = asset.field_level;
  like.layout = {asset.gaussians, asset.sh_degree};
  like.least_anchors = asset.least_anchors;
  like.most_anchors = asset.most_anchors;
  like.colour_space = asset.colour_space;
  like.antialias = asset.antialias;
  try {
    auto density = std::make_shared<const OctreeDensity>(OctreeDensity::fromLevels(
        root, std::move(asset.cells), std::move(asset.log_probabilities)));
    auto field = std::make_shared<const FieldParameters>(fieldOfTensors(asset.tensors, like));
    return {FieldSource{std::move(density),
                        std::make_shared<const FieldDecoder>(std::move(field)),
                        {asset.jitter, asset.nested, asset.seed}},
            std::move(notes)};
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, path + ": " + error.what());
  }
}

void saveField(const FieldSource& source, const ModelNotes& notes, const std::string& path) {
  const FieldParameters& field = source.decoder->field();
  FieldAsset asset;
  static_cast<OctreeTensors&>(asset) = octreeOf(*source.density);
  asset.contracted = field.contracted;
  asset.field_level = field.leaf_level;
  asset.gaussians = field.layout.gaussians;
  asset.sh_degree = field.layout.sh_degree;
  asset.least_anchors = field.least_anchors;
  asset.most_anchors = field.most_anchors;
  asset.jitter = source.draws.jitter;
  asset.nested = source.draws.nested;
  asset.seed = source.draws.seed;
  asset.colour_space = field.colour_space;
  asset.antialias = field.antialias;
  asset.tensors = tensorsOfField(field);
  asset.settings_json = notes.settings_json;
  asset.extras = notes.extras;
  writeFieldAsset(asset, path);
}

}  // namespace stipple::api
