#include "fit/training/detail_objects.h"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include "base/error.h"
#include "decode/tree/merge_tree.h"
#include "fit/fit_session.h"
#include "io/splats/splat_file.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;

constexpr char kStage[] = "Fitting objects";

/// Where the fitted cloud of an object is kept: fits of other settings have other folders.
fs::path keptPath(const TrainingConfig& config, const std::string& object) {
  const std::string fits = "fits_" + std::to_string(config.detail.fit_steps) + "_" +
                           std::to_string(config.detail.fit_splats) + "_" +
                           std::to_string(config.seed);
  return fs::path(config.out) / fits / object / "coarse.ply";
}

SplatCloud fitted(const std::shared_ptr<const BackendFactory>& backends,
                  const std::shared_ptr<const NormalisedViews>& views, const TrainingConfig& config,
                  Progress* progress) {
  FitOptions options = defaultFitOptions();
  applyPreset(options, FitKind::kExplicit, FitQuality::kFast);
  options.iterations = config.detail.fit_steps;
  options.max_splats = config.detail.fit_splats;
  options.start_splats = std::max<uint64_t>(1, config.detail.fit_splats / 2);
  options.sh_degree = 0;
  options.holdout = 0;
  options.seed = config.seed;
  // Measuring in between chooses the best state, at a cost of many steps.
  options.measure_interval = options.iterations;
  FitSession session(backends, views, options);
  Progress own;
  if (progress == nullptr) progress = &own;
  session.run(*progress);
  progress
      ->throwIfCancelled();  // A fit that is cancelled ends with what it has, which is too little.
  return *session.decode(0).cloud;
}

/// In the networks' cube.
SplatCloud inCube(SplatCloud cloud, const LatentPlacement& placement) {
  for (size_t i = 0; i < cloud.positions.size(); ++i) {
    cloud.positions[i] = static_cast<float>(
        (static_cast<double>(cloud.positions[i]) - placement.offset[i % 3]) / placement.scale);
    cloud.scales[i] = static_cast<float>(static_cast<double>(cloud.scales[i]) / placement.scale);
  }
  return cloud;
}

void makeFolder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (!error) return;
  fail(ErrorCode::kIo, "the folder '" + folder.string() + "' cannot be made: " + error.message());
}

}  // namespace

FittedObjects::FittedObjects(const std::shared_ptr<const BackendFactory>& backends,
                             std::shared_ptr<const Collection> collection,
                             const TrainingConfig& config, GradientExchange& exchange,
                             Progress* progress)
    : collection_(std::move(collection)) {
  const auto ownPath = [&](size_t object) {
    return fs::path(config.collection) / collection_->name(object) / "coarse.ply";
  };
  for (size_t i = 0; exchange.rank() == 0 && i < collection_->count(); ++i) {
    const fs::path kept = keptPath(config, collection_->name(i));
    if (fs::exists(ownPath(i)) || fs::exists(kept)) continue;
    if (progress != nullptr) {
      progress->enterPart(0, 0);
      progress->advance(0, kStage);
    }
    const SplatCloud cloud = fitted(backends, collection_->views(i), config, progress);
    makeFolder(kept.parent_path());
    writeSplatFile(cloud, kept.string(), {});
  }
  float made = 1;  // Only a sign that all are there.
  exchange.share({&made, 1});
  for (size_t i = 0; i < collection_->count(); ++i) {
    if (progress != nullptr) progress->throwIfCancelled();
    const bool is_own = fs::exists(ownPath(i));
    const std::string path =
        is_own ? ownPath(i).string() : keptPath(config, collection_->name(i)).string();
    SplatCloud cloud = readSplatFile(path);
    if (cloud.size() == 0) fail(ErrorCode::kInvalidArgument, path + " has no splats");
    if (cloud.colour_space != collection_->views(i)->colourSpace()) {
      fail(ErrorCode::kInvalidArgument,
           path + " has colours of another space than the images of its object");
    }
    if (is_own) cloud = inCube(std::move(cloud), collection_->views(i)->placement());
    const auto leaves = std::make_shared<const SplatCloud>(std::move(cloud));
    auto tree = std::make_shared<const MergeTree>(buildMergeTree(*leaves, {}, {}));
    trees_.push_back(std::make_unique<const HierarchyDecoder>(leaves, std::move(tree)));
  }
}

SplatCloud FittedObjects::coarse(size_t object, uint64_t splats) const {
  const HierarchyDecoder& tree = *trees_[object];
  DecodeRequest request;
  request.budget = std::min<uint64_t>(splats, tree.leaves()->size());
  return tree.decode(request);
}

}  // namespace stipple
