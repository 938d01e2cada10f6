#include "fit/training/encode_object.h"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "base/error.h"
#include "fit/training/collection.h"
#include "fit/training/training_config.h"
#include "io/assets/weight_file.h"
#include "io/bytes/input_file.h"
#include "io/views/dataset.h"
#include "io/views/ply_points.h"
#include "model/latent_splats.h"

namespace stipple {

namespace {

constexpr char kStage[] = "Encoding the object";
constexpr double kEncodedShare = 0.8;  ///< of the whole work, before the file is identified

[[noreturn]] void refuse(const std::string& message) {
  fail(ErrorCode::kInvalidArgument, message);
}

/// Trained weights, and what they were trained with.
struct TrainedNetworks {
  WeightTable weights;
  TrainingConfig config;

  explicit TrainedNetworks(const std::string& path) {
    std::map<std::string, std::string> metadata;
    weights = openWeightFile(path, &metadata);
    const auto settings = metadata.find(kTrainedKey);
    if (settings == metadata.end()) {
      refuse(path + " was not written by a training of ours: its metadata has no '" +
             std::string(kTrainedKey) + "'");
    }
    config = readSettings(settings->second, path);
    if (config.learns_detail) {
      refuse(path + " holds a network that adds detail; weights of an autoencoder are needed");
    }
  }

  uint64_t tokens() const {
    uint64_t most = 1;
    for (const AutoencoderSchedule& part : config.parts) {
      most = std::max<uint64_t>(most, part.most_tokens);
    }
    return most;
  }
};

PointSet pointsOf(const std::string& path) {
  if (lowerExtension(path) == ".ply") return readPlyPoints(path);
  return openDataset(path)->points();
}

}  // namespace

std::shared_ptr<const SplatModel> encodeObject(const EncodeRequest& request, Progress* progress) {
  advance(progress, 0.0, kStage);
  const TrainedNetworks trained(request.weights_path);
  const DensityAutoencoder networks(trained.config.sizes);
  const std::vector<float> values = networks.layout().read(trained.weights);
  const PointSet points = pointsOf(request.object_path);
  auto latent = std::make_shared<Latent>();
  TrainingObject object;
  try {
    latent->placement = placementAround(points);
    object =
        readTrainingPoints(normalised(points, latent->placement), trained.config.objects.points);
  } catch (const Error& error) {
    fail(error.code(), request.object_path + ": " + error.what());
  }
  const uint64_t wanted = request.tokens == 0 ? trained.tokens() : request.tokens;
  const uint64_t most = object.points[0].size() / 3;
  if (request.tokens > most) {
    refuse("the number of tokens is " + std::to_string(request.tokens) + "; 1 to " +
           std::to_string(most) + ", the number of points that are encoded, is allowed");
  }
  latent->token_count = std::min(wanted, most);
  latent->width = static_cast<uint32_t>(trained.config.sizes.latent_width);
  latent->tokens = networks.encode(values, object, latent->token_count);
  if (progress != nullptr) progress->enterPart(kEncodedShare, 1);
  WeightsReference reference = referenceOf(request.weights_path, progress);
  if (progress != nullptr) progress->enterPart(0, 1);
  advance(progress, 1.0, kStage);
  return makeLatentSplats(openLatentNetworks(request.weights_path), std::move(latent),
                          std::move(reference));
}

uint64_t encodeMemoryBound(const EncodeRequest& request) {
  const TrainedNetworks trained(request.weights_path);
  const AutoencoderSizes& sizes = trained.config.sizes;
  const uint64_t width = sizes.heads * sizes.head_width;
  const uint64_t tokens = std::max(trained.tokens(), request.tokens);
  // Weights twice; points with their keys and values; tokens of all blocks.
  return DensityAutoencoder(sizes).layout().size() * 2 * sizeof(float) +
         kMostEncodedPoints * (8 + 3 * width) * sizeof(float) +
         tokens * width * (sizes.encoder_blocks + 2 * sizes.mlp_ratio + 8) * sizeof(float);
}

}  // namespace stipple
