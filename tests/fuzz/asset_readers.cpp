#include "asset_readers.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>

#include "decode/anchors/key_frame.h"
#include "decode/anchors/scaffold_decoder.h"
#include "decode/anchors/scaffold_tensors.h"
#include "decode/surface/surface_model.h"
#include "decode/tree/hierarchy_decoder.h"
#include "density/octree_density.h"
#include "io/assets/hierarchy_asset.h"
#include "io/assets/latent_asset.h"
#include "io/assets/motion_asset.h"
#include "io/assets/relay_asset.h"
#include "io/assets/rest_mesh.h"
#include "io/assets/scaffold_asset.h"
#include "io/assets/surface_asset.h"
#include "io/random_cloud.h"
#include "reader_tools.h"

namespace stipple::fuzz {

namespace fs = std::filesystem;

namespace {

void fillMoving(MotionTensors& tensors, size_t count, int degree) {
  tensors.splats = randomCloud(count, degree, 1);
  for (auto& wave : tensors.waves) wave.assign(3 * count, 0.25f);
  tensors.phases.assign(4 * count, 0.5f);
  tensors.spins.assign(4 * count, 0.1f);
  tensors.lifespans.assign(2 * count, 0.75f);
  tensors.centres.assign(count, 0.5f);
}

}  // namespace

/// What loading a model does with an asset, as far as a wrong file can reach.
void readSurface(const fs::path& path) {
  SurfaceAsset asset = readSurfaceAsset(path.string());
  RootCube root;
  root.origin = asset.root_origin;
  root.side = asset.root_side;
  try {
    auto density = std::make_shared<const OctreeDensity>(OctreeDensity::fromLevels(
        root, std::move(asset.cells), std::move(asset.log_probabilities)));
    surfaceModelFromParts(std::make_shared<const PointSet>(std::move(asset.surface)), density);
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, error.what());
  }
}

void readHierarchy(const fs::path& path) {
  HierarchyAsset asset = readHierarchyAsset(path.string());
  auto leaves = std::make_shared<const SplatCloud>(std::move(asset.leaves));
  auto tree = std::make_shared<MergeTree>();
  tree->nodes = std::move(asset.nodes);
  tree->parents = std::move(asset.parents);
  tree->errors = std::move(asset.errors);
  std::shared_ptr<const HierarchyDecoder> decoder;
  try {
    decoder = std::make_shared<const HierarchyDecoder>(leaves, tree);
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, error.what());
  }
  keepsPromises([&] {
    DecodeRequest request;
    for (const uint64_t budget : {size_t{1}, (leaves->size() + 1) / 2, leaves->size()}) {
      request.budget = budget;
      const SplatCloud cut = decoder->decode(request);
      validate(cut, "cut");
      if (cut.size() != budget) fail(ErrorCode::kInternal, "the cut has another size");
    }
  });
}

std::vector<std::string> surfaceSeeds(const fs::path& folder) {
  SurfaceAsset asset;
  const float all = std::log(1.0f / 8.0f), none = -HUGE_VALF;
  asset.cells = {{0}, {2}};
  asset.log_probabilities = {{none, none, 0.0f, none, none, none, none, none},
                             std::vector<float>(8, all)};
  asset.surface.positions = {0, 0, 0, 1, 1, 1};
  asset.surface.normals = {0, 0, 1, 1, 0, 0};
  asset.surface.colours = {0.5f, 0.5f, 0.5f, 1, 0, 0};
  asset.surface.opacities = {1, 0.5f};
  asset.surface.areas = {1, 2};
  asset.surface.weights = {0.5f, 0.5f};
  writeSurfaceAsset(asset, (folder / "seed").string());
  return {load(folder / "seed")};
}

std::vector<std::string> hierarchySeeds(const fs::path& folder) {
  std::vector<std::string> made;
  for (const int degree : {0, 2}) {
    HierarchyAsset asset;
    asset.leaves = randomCloud(3, degree, 1);
    asset.nodes = randomCloud(2, degree, 2);
    asset.parents = {UINT32_MAX, 0, 0, 1, 1};
    asset.errors = {0.5f, 0.25f};
    writeHierarchyAsset(asset, (folder / "seed").string());
    made.push_back(load(folder / "seed"));
  }
  return made;
}

std::vector<std::string> motionSeeds(const fs::path& folder) {
  std::vector<std::string> made;
  for (const int degree : {0, 2}) {
    MotionAsset asset;
    fillMoving(asset, 3, degree);
    asset.frame_count = 9;
    if (degree == 2) {
      fillMoving(asset.nodes, 2, degree);
      asset.parents = {UINT32_MAX, 0, 0, 1, 1};
      asset.errors = {0.5f, 0.25f};
    }
    writeMotionAsset(asset, (folder / "seed").string());
    made.push_back(load(folder / "seed"));
    writeRestMesh((folder / "seed").string(), {{0, 0, 0, 1, 0, 0, 0, 1, 0}, {0, 1, 2}, 7, true},
                  (folder / "seed").string());
    made.push_back(load(folder / "seed"));
  }
  return made;
}

std::vector<std::string> latentSeeds(const fs::path& folder) {
  LatentAsset asset;
  asset.latent.token_count = 3;
  asset.latent.width = 2;
  asset.latent.tokens = {1, 2, 3, 4, 5, 6};
  asset.weights = {"decoder.safetensors", 576148442, std::string(64, 'a')};
  writeLatentAsset(asset, (folder / "seed").string());
  return {load(folder / "seed")};
}

ScaffoldParameters fewAnchors() {
  ScaffoldParameters scaffold = makeScaffold({.gaussians = 2, .sh_degree = 1});
  const float place[] = {1, 2, 3};
  for (int a = 0; a < 3; ++a) addAnchor(scaffold, place, nullptr, 0.5f);
  return scaffold;
}

std::vector<std::string> scaffoldSeeds(const fs::path& folder) {
  ScaffoldAsset asset;
  asset.gaussians = 2;
  asset.sh_degree = 1;
  asset.tensors = tensorsOfScaffold(fewAnchors());
  writeScaffoldAsset(asset, (folder / "seed").string());
  return {load(folder / "seed")};
}

std::vector<std::string> relaySeeds(const fs::path& folder) {
  RelayAssetHead head;
  head.frame_count = 9;
  head.spacing = 4;
  head.gaussians = 2;
  head.sh_degree = 1;
  head.anchor_counts = {3, 3};
  std::vector<TensorTable> keys;
  for (int key = 0; key < 2; ++key) {
    KeyFrame frame;
    frame.scaffold = fewAnchors();
    frame.blend.assign(3 * kBlendNumbers, 0.5f);
    HexPlaneShape shape;
    shape.texels = shape.moments = 2;
    shape.channels = 1;
    shape.multipliers = {1};
    if (key == 1) frame.deformation = makeDeformation(shape, 2);
    keys.push_back(tensorsOfKeyFrame(frame, ""));
  }
  writeRelayAsset(
      head, [&](uint32_t key) { return keys[key]; }, (folder / "seed").string());
  return {load(folder / "seed")};
}

void readScaffold(const fs::path& path) {
  const ScaffoldAsset asset = readScaffoldAsset(path.string());
  const auto scaffold = std::make_shared<const ScaffoldParameters>(scaffoldOfTensors(
      asset.tensors, {asset.gaussians, asset.sh_degree, asset.colour_space, asset.antialias, 0}));
  keepsPromises([&] {
    DecodeRequest request;
    request.budget = 1000;
    request.gaussians_per_anchor = asset.gaussians;
    validate(ScaffoldDecoder(scaffold).decode(request), "splats of a file");
    writeScaffoldAsset(asset, (path.parent_path() / "again").string());
  });
}

void readRelay(const fs::path& path) {
  const RelayAsset asset(path.string());
  const RelayAssetHead& head = asset.head();
  const ScaffoldShape shape = {head.gaussians, head.sh_degree, head.colour_space, head.antialias,
                               0};
  for (uint32_t key = 0; key < std::min<size_t>(head.anchor_counts.size(), 3); ++key) {
    const KeyFrame frame = keyFrameOfTensors(asset.key(key), "", shape);
    keepsPromises([&] {
      KeyFrameTape tape;
      SplatCloud cloud;
      splatsOfKeyFrame(frame, frame.scaffold.size(), -0.3, tape, cloud);
      validate(cloud, "splats of a file");
    });
  }
}

void readMotion(const fs::path& path) {
  const MotionAsset asset = readMotionAsset(path.string());
  const std::string again = (path.parent_path() / "again").string();
  if (const auto rest = readRestMesh(path.string())) {
    keepsPromises([&] { writeRestMesh(path.string(), *rest, again); });
  }
  keepsPromises([&] { writeMotionAsset(asset, again); });
}

void readLatent(const fs::path& path) {
  const LatentAsset asset = readLatentAsset(path.string());
  keepsPromises([&] { writeLatentAsset(asset, (path.parent_path() / "again").string()); });
}

}  // namespace stipple::fuzz
