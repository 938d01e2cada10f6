// Based on: Nam et al., Generative Densification, CVPR 2025.
#include "fit/adding_detail.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "base/error.h"
#include "fit/fit_memory.h"
#include "fit/training/training_config.h"
#include "io/assets/weight_file.h"
#include "train/detail/detail_model.h"
#include "train/loop/picture_store.h"

namespace stipple {

namespace {

constexpr uint32_t kMostViews = 64;
/// Longest side of an image as the network sees it, pixels: larger ones are made smaller.
constexpr uint32_t kLongestSide = 1024;
constexpr char kStage[] = "Adding detail";

[[noreturn]] void refuse(const std::string& message) {
  fail(ErrorCode::kInvalidArgument, message);
}

TrainingConfig configOf(const std::map<std::string, std::string>& metadata,
                        const std::string& path) {
  const auto settings = metadata.find(kTrainedKey);
  if (settings == metadata.end()) {
    refuse(path + " was not written by a training of ours: its metadata has no '" +
           std::string(kTrainedKey) + "'");
  }
  TrainingConfig config = readSettings(settings->second, path);
  if (!config.learns_detail) {
    refuse(path + " holds no network that adds detail; a training with \"detail\" writes one");
  }
  return config;
}

}  // namespace

struct DetailAdding::Network {
  TrainingConfig config;
  DetailModel model;
  std::vector<float> values;

  static Network open(const std::string& path) {
    std::map<std::string, std::string> metadata;
    const WeightTable weights = openWeightFile(path, &metadata);
    TrainingConfig config = configOf(metadata, path);
    DetailModel model(config.detail.sizes);
    std::vector<float> values = model.layout().read(weights);
    for (const float value : values) {
      if (!std::isfinite(value)) {
        fail(ErrorCode::kFormat, path + " has weights that are not finite");
      }
    }
    return {std::move(config), std::move(model), std::move(values)};
  }
};

DetailAdding::DetailAdding(std::shared_ptr<const BackendFactory> backends,
                           std::shared_ptr<const SplatCloud> cloud,
                           std::shared_ptr<const ViewSource> views, const std::string& weights_path,
                           const AddDetailOptions& options)
    : backends_(std::move(backends)),
      cloud_(std::move(cloud)),
      views_(std::move(views)),
      network_(std::make_unique<const Network>(Network::open(weights_path))) {
  const uint64_t count = cloud_->size();
  if (count == 0) refuse("the cloud has 0 splats; one or more are needed");
  validate(*cloud_, "the cloud");
  if (views_->count() == 0) refuse("there are 0 views; one or more are needed");
  if (views_->colourSpace() != cloud_->colour_space) {
    refuse(
        "the splats and the images are of different colour spaces: one is scene linear, the "
        "other as shown");
  }
  if (options.view_count > kMostViews) {
    refuse("the number of views is " + std::to_string(options.view_count) + "; 0 to " +
           std::to_string(kMostViews) + " is allowed");
  }
  const DetailModel& model = network_->model;
  const uint64_t most = model.splatCount(count, count);
  const uint64_t wanted = options.max_splats == 0 ? most : options.max_splats;
  points_ = model.pointsFor(count, wanted);
  if (points_ == 0) {
    refuse("the number of splats is " + std::to_string(wanted) + "; of " + std::to_string(count) +
           " splats this network makes " + std::to_string(model.splatCount(count, 1)) + " to " +
           std::to_string(most));
  }
  const size_t told =
      options.view_count == 0 ? network_->config.detail.schedule.views : options.view_count;
  view_count_ = std::min(told, views_->count());
}

DetailAdding::~DetailAdding() = default;

uint64_t DetailAdding::memoryBound() const {
  const DetailModelSizes& sizes = network_->model.sizes();
  const uint64_t width = sizes.heads * sizes.head_width;
  // Rows of children, of which up-sampling keeps most, and of points in views.
  const uint64_t rows = network_->model.splatCount(cloud_->size(), points_) +
                        points_ * static_cast<uint64_t>(view_count_);
  uint64_t drawing = 0;
  for (size_t view = 0; view < views_->count(); ++view) {
    drawing = std::max(drawing, backends_->passMemory(*cloud_, views_->camera(view), {}));
  }
  // Each view keeps its image and what is drawn of it.
  constexpr uint64_t kPixelBytes = 48;
  const uint64_t kept = uint64_t{kLongestSide} * kLongestSide * kPixelBytes;
  return rows * (8 * width + 512) * (sizes.blocks + 1) * sizeof(float) + 2 * drawing +
         view_count_ * kept + pictureMemoryBound(*views_, 0);
}

SplatCloud DetailAdding::run(Progress* progress) const {
  constexpr double kBlack[3] = {0, 0, 0};
  PictureStore pictures(views_, 0);
  std::vector<DetailView> told;
  for (size_t i = 0; i < view_count_; ++i) {
    advance(progress, 0.5 * static_cast<double>(i) / static_cast<double>(view_count_), kStage);
    const size_t view = i * views_->count() / view_count_;
    TargetPicture picture;
    pictures.load(view, kBlack, picture);
    Camera camera = views_->camera(view);
    const uint32_t side = std::max(camera.width, camera.height);
    if (side > kLongestSide) {
      reducePicture((side + kLongestSide - 1) / kLongestSide, picture, camera);
    }
    told.push_back({camera, std::move(picture.colour), std::move(picture.alpha)});
  }
  advance(progress, 0.5, kStage);
  const CoarseEvidence evidence =
      gatherEvidence(*backends_, *cloud_, told, static_cast<size_t>(points_), progress);
  if (std::all_of(evidence.shows.begin(), evidence.shows.end(),
                  [](uint8_t shows) { return shows == 0; })) {
    refuse("none of " + std::to_string(view_count_) +
           " views shows any of the splats: splats and cameras have to be in the same place");
  }
  advance(progress, 0.8, kStage);
  DetailModel::Tape tape;
  SplatCloud fine = network_->model.forward(network_->values, *cloud_, evidence, tape);
  validate(fine, "the finer splats");
  advance(progress, 1.0, kStage);
  return fine;
}

}  // namespace stipple
