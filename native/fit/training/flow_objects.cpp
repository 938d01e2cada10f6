// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355), the data of its flow network.
// Differs: latents are the encoder's means.
#include "fit/training/flow_objects.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/error.h"
#include "train/networks/token_order.h"

namespace stipple {

namespace {

constexpr float kMiddle = 0.5f;  ///< of the unit cube

/// Points of the unit cube turned about its vertical axis.
void turnPoints(int quarters, std::vector<float>& points) {
  for (size_t i = 0; i < points.size(); i += 3) {
    for (int turn = 0; turn < quarters; ++turn) {
      const float x = points[i] - kMiddle, y = points[i + 1] - kMiddle;
      points[i] = kMiddle - y;
      points[i + 1] = kMiddle + x;
    }
  }
}

/// A view as a file of an image has it: straight alpha, display values.
ByteImage byteImage(const ViewPicture& picture) {
  ByteImage image;
  image.width = picture.width;
  image.height = picture.height;
  image.channels = 4;
  image.pixels.resize(size_t{picture.width} * picture.height * 4);
  const auto byte = [](float value) {
    return static_cast<uint8_t>(std::lround(255.0f * std::clamp(value, 0.0f, 1.0f)));
  };
  for (size_t i = 0; i < picture.alpha.size(); ++i) {
    const float alpha = picture.alpha[i];
    for (size_t c = 0; c < 3; ++c) {
      image.pixels[i * 4 + c] = alpha > 0 ? byte(picture.colour[i * 3 + c] / alpha) : uint8_t{0};
    }
    image.pixels[i * 4 + 3] = byte(alpha);
  }
  return image;
}

PreparedImage preparedView(const NormalisedViews& views, size_t view, const PatchSizes& patches) {
  PreparationOptions options;
  options.canvas_size = patches.canvas;
  return prepareImage(byteImage(views.load(view)), nullptr, options);
}

}  // namespace

std::array<float, 5> flowCamera(const Camera& camera) {
  const double half = 0.5 * camera.width / camera.fx;
  // Of an orthographic camera, the way it looks from tells the direction.
  const bool is_flat = camera.model == CameraModel::kOrthographic;
  const Vec3d centre =
      is_flat ? Vec3d(-camera.world_to_camera.block<1, 3>(2, 0).transpose()) : cameraCentre(camera);
  const double distance = centre.norm();
  const Vec3d direction = distance > 0 ? Vec3d(centre / distance) : Vec3d(1, 0, 0);
  return {static_cast<float>(direction[0]), static_cast<float>(direction[1]),
          static_cast<float>(direction[2]),
          is_flat || !(distance > 0) ? 0.0f : static_cast<float>(1 / distance),
          static_cast<float>(is_flat ? half : distance * half)};
}

int quarterTurns(const Camera& camera) {
  const std::array<float, 5> seen = flowCamera(camera);
  const double yaw = std::atan2(static_cast<double>(seen[1]), static_cast<double>(seen[0]));
  const auto turns = static_cast<int>(std::lround(-yaw / (std::numbers::pi / 2)));
  return (turns % 4 + 4) % 4;
}

FlowObjects::FlowObjects(std::shared_ptr<const Collection> collection, std::vector<size_t> objects,
                         const DensityAutoencoder& networks, std::span<const float> values,
                         const FlowObjectOptions& options, Progress* progress)
    : collection_(std::move(collection)),
      objects_(std::move(objects)),
      options_(options),
      width_(networks.sizes().latent_width) {
  validate(options.patches);
  for (size_t i = 0; i < objects_.size(); ++i) {
    advance(progress, static_cast<double>(i) / static_cast<double>(objects_.size()),
            "Encoding objects");
    const NormalisedViews& views = *collection_->views(objects_[i]);
    TrainingObject object = *collection_->object(objects_[i]);
    Encoded made;
    tokens_ = std::min(options.tokens, object.points[0].size() / 3);
    for (int turns = 0; turns < 4; ++turns) {
      if (turns > 0) turnPoints(1, object.points[0]);
      const std::vector<float> tokens = networks.encode(values, object, tokens_);
      std::vector<float>& ordered = made.tokens[static_cast<size_t>(turns)];
      ordered = tokens;
      if (!options.in_order) continue;
      std::vector<float> places;
      for (const uint32_t point : farthestPoints(object.points[0], tokens_)) {
        const float* const at = &object.points[0][size_t{point} * 3];
        places.insert(places.end(), at, at + 3);
      }
      const std::vector<uint32_t> order = tokenOrder(places, progress);
      for (size_t j = 0; j < order.size(); ++j) {
        std::copy_n(&tokens[order[j] * width_], width_, &ordered[j * width_]);
      }
    }
    for (size_t view = 0; view < views.count(); ++view) {
      try {
        preparedView(views, view, options.patches);
        made.views.push_back(view);
      } catch (const Error& error) {
        if (error.code() != ErrorCode::kInvalidArgument) throw;
      }
    }
    if (made.views.empty()) {
      fail(ErrorCode::kInvalidArgument, "object '" + collection_->name(objects_[i]) +
                                            "' has no image that shows it alone and whole");
    }
    encoded_.push_back(std::move(made));
  }
}

FlowObject FlowObjects::object(size_t index, uint64_t draw) const {
  const Encoded& encoded = encoded_[index];
  const NormalisedViews& views = *collection_->views(objects_[index]);
  const size_t view = encoded.views[draw % encoded.views.size()];
  const int turns = quarterTurns(views.camera(view));
  FlowObject made;
  made.latent.token_count = tokens_;
  made.latent.width = static_cast<uint32_t>(width_);
  made.latent.tokens = encoded.tokens[static_cast<size_t>(turns)];
  made.latent.camera = flowCamera(views.camera(view));
  for (int turn = 0; turn < turns; ++turn) {
    const float x = made.latent.camera[0];
    made.latent.camera[0] = -made.latent.camera[1];
    made.latent.camera[1] = x;
  }
  made.condition = patchCondition(preparedView(views, view, options_.patches), options_.patches);
  return made;
}

}  // namespace stipple
