// Based on: the released pipeline of arXiv 2605.16355. Differs: all noise comes from one seed, work
// can be interrupted and continued, and previews are decoded on the way.
#include "fit/generate_session.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/number_text.h"
#include "base/progress.h"
#include "base/stopwatch.h"
#include "decode/latent/latent_decoder.h"
#include "decode/latent/latent_networks.h"
#include "fit/image_encoders.h"
#include "fit/image_likeness.h"
#include "fit/image_matching.h"
#include "fit/machine_speed.h"
#include "fit/object_placement.h"
#include "fit/training/training_config.h"
#include "generate/flow_cost.h"
#include "generate/flow_network.h"
#include "generate/image_condition.h"
#include "io/assets/checkpoint.h"
#include "io/assets/weight_file.h"
#include "io/assets/weights_reference.h"
#include "io/bytes/sha256.h"
#include "model/latent_splats.h"

namespace stipple {

namespace {

// What layers pack and threads work in, about (docs/methods/image_encoders.md has measurements).
constexpr uint64_t kLayerBytes = uint64_t{96} << 20;
constexpr double kLargestSize = 1e6;  // metres
// Of the whole work, what comes before the encoders, behind the last step, and behind what is done
// with the result. Colours are matched with small networks alone, where that takes longest.
constexpr double kPreparationShare = 0.01, kSampledShare = 0.96, kMeasuredShare = 0.98;
constexpr double kSampledBeforeMatching = 0.2, kDecodedShare = 0.25;

FlowSettings flowSettings(const GenerateOptions& options) {
  return {options.steps, options.guidance, options.shift};
}

std::map<std::string, std::string> metadataOf(const std::string& path) {
  std::map<std::string, std::string> metadata;
  openWeightFile(path, &metadata);
  return metadata;
}

/// The networks up to the latent. What is large stays in their files.
struct Networks {
  WeightsFolder folder;
  FlowNetwork flow;
  LatentNetworks decoder;
  std::optional<TrainingConfig> trained;  ///< empty: as published
  ImageEncoders encoders;

  explicit Networks(const GenerateOptions& options)
      : folder(findWeights(options.weights_folder)),
        flow(openWeightFile(pathOf(WeightsRole::kFlow))),
        decoder(openLatentNetworks(pathOf(WeightsRole::kDecoder))),
        trained(trainedConfig()),
        encoders(trained ? ImageEncoders(trained->flow.patches)
                         : ImageEncoders(folder, options.structure_head_width)) {
    const FlowSizes& sizes = flow.sizes();
    if (sizes.structure_width != encoders.structureWidth() ||
        sizes.colour_width != encoders.colourWidth()) {
      fail(ErrorCode::kFormat,
           "the files of weights do not fit together: the flow network takes features of " +
               std::to_string(sizes.structure_width) + " and " +
               std::to_string(sizes.colour_width) + " numbers, the encoders give " +
               std::to_string(encoders.structureWidth()) + " and " +
               std::to_string(encoders.colourWidth()));
    }
  }

  const std::string& pathOf(WeightsRole role) const { return requireWeights(folder, role).path; }
  std::optional<TrainingConfig> trainedConfig() const {
    const std::string& path = pathOf(WeightsRole::kFlow);
    const std::map<std::string, std::string> metadata = metadataOf(path);
    if (latentsOf(metadata) != latentsOf(metadataOf(pathOf(WeightsRole::kDecoder)))) {
      fail(ErrorCode::kFormat, "the files of weights do not fit together: " + path + " and " +
                                   pathOf(WeightsRole::kDecoder) + " are of different trainings");
    }
    const auto settings = metadata.find(kTrainedKey);
    if (settings == metadata.end()) return std::nullopt;
    return readSettings(settings->second, path);
  }
  /// Networks that were trained here see images as they saw them there, and say no more tokens than
  /// they learned.
  GenerateOptions adapted(GenerateOptions options) const {
    if (!trained) return options;
    options.preparation.canvas_size = trained->flow.patches.canvas;
    options.token_count =
        std::min<uint64_t>(options.token_count, trained->parts.back().most_tokens);
    options.preview_anchors = std::min(options.preview_anchors, decoder.range.most_anchors);
    return options;
  }
  double encoderWork(uint32_t size) const { return encoders.flops(size); }
  StageCost samplingCost(const GenerateOptions& options) const {
    return flowSamplingCost(flow.sizes(), options.token_count, rows(options),
                            flowSettings(options));
  }
  StageCost stepCost(const GenerateOptions& options) const {
    GenerateOptions one = options;
    one.steps = 1;
    StageCost cost = samplingCost(one);
    cost.flops -= flowContextCost(flow.sizes(), rows(options)).flops;
    return cost;
  }
  uint64_t rows(const GenerateOptions& options) const {
    return encoders.rows(options.preparation.canvas_size);
  }
};

/// What decodes a latent, as it was trained here: with derivatives. The file itself says how large
/// it is, since a joint part may have changed what the flow's file says of it.
DensityAutoencoder differentiableDecoder(const Networks& networks) {
  const std::string& path = networks.pathOf(WeightsRole::kDecoder);
  const std::map<std::string, std::string> metadata = metadataOf(path);
  const auto settings = metadata.find(kTrainedKey);
  if (settings == metadata.end()) {
    fail(ErrorCode::kInvalidArgument,
         "colours are matched with networks that 'stipple train' has learned, and " + path +
             " holds others; leave this out for them");
  }
  return DensityAutoencoder(readSettings(settings->second, path).sizes);
}

void requireOptions(const GenerateOptions& options) {
  validate(flowSettings(options));
  validate(options.preparation);
  if (options.token_count == 0 || options.token_count > kMostFlowTokens) {
    fail(ErrorCode::kInvalidArgument, "the number of tokens is " +
                                          std::to_string(options.token_count) + "; 1 to " +
                                          std::to_string(kMostFlowTokens) + " is allowed");
  }
  if (options.preview_anchors == 0) {
    fail(ErrorCode::kInvalidArgument, "the anchors of a preview are 0; 1 or more is allowed");
  }
  if (!(options.size >= 0) || options.size > kLargestSize) {
    fail(ErrorCode::kInvalidArgument, "the size of the object is " + numberText(options.size) +
                                          " m; 0 to " + numberText(kLargestSize) + " is allowed");
  }
}

/// Encoders work one after the other, and their memory is free before the flow network begins.
uint64_t workBytes(const Networks& networks, const GenerateOptions& options) {
  const uint64_t rows = networks.rows(options);
  const ImageEncoders& encoders = networks.encoders;
  const uint64_t condition =
      rows * (encoders.structureWidth() + encoders.colourWidth()) * sizeof(float);
  const uint64_t flow = networks.flow.memoryBound(options.token_count, rows);
  const uint64_t matching = options.matches_colours ? matchingBytes(differentiableDecoder(networks),
                                                                    options.preview_anchors,
                                                                    options.preparation.canvas_size)
                                                    : 0;
  return condition + kLayerBytes +
         std::max({encoders.memoryBound(options.preparation.canvas_size), flow, matching});
}

/// What a checkpoint must agree in, as JSON.
std::string keyOf(const Networks& networks, const GenerateOptions& options,
                  const PreparedImage& prepared) {
  Sha256 image;
  image.add(prepared.rgb.data(), prepared.rgb.size());
  const auto text = [](uint64_t value) { return std::to_string(value); };
  std::string key = "{\"image\":\"" + image.finish() + "\",\"seed\":\"" + text(options.noise.seed) +
                    "\",\"noise\":" + text(static_cast<uint64_t>(options.noise.source)) +
                    ",\"mean_colour\":" + text(options.uses_mean_colour ? 1 : 0) +
                    ",\"tokens\":" + text(options.token_count) +
                    ",\"steps\":" + text(options.steps) +
                    ",\"guidance\":" + numberText(options.guidance, 17) +
                    ",\"shift\":" + numberText(options.shift, 17) + ",\"weights\":[";
  for (const WeightsFile& file : networks.folder.files) {
    if (key.back() != '[') key += ',';
    key += text(file.bytes);
  }
  return key + "]}";
}

/// What the features of an image depend on.
std::string featuresKeyOf(const Networks& networks, const GenerateOptions& options,
                          const PreparedImage& prepared) {
  Sha256 image;
  image.add(prepared.rgb.data(), prepared.rgb.size());
  std::string key = image.finish() + " " + std::to_string(prepared.size) + " " +
                    std::to_string(options.structure_head_width);
  for (const WeightsRole role : networks.encoders.roles()) {
    const WeightsFile& file = networks.folder.of(role);
    key +=
        "\n" + file.path + " " + std::to_string(file.bytes) + " " + std::to_string(file.modified);
  }
  return key;
}

/// Features with what they depend on.
struct KeyedFeatures {
  std::string key;
  ImageFeatures features;
};

StageValues valuesOf(std::string name, std::span<const float> numbers) {
  StageValues values;
  values.name = std::move(name);
  values.count = numbers.size();
  if (numbers.empty()) return values;
  double sum = 0, squares = 0;
  values.minimum = values.maximum = static_cast<double>(numbers[0]);
  for (const float number : numbers) {
    const auto value = static_cast<double>(number);
    values.minimum = std::min(values.minimum, value);
    values.maximum = std::max(values.maximum, value);
    sum += value;
    squares += value * value;
  }
  const auto count = static_cast<double>(numbers.size());
  values.mean = sum / count;
  values.deviation = std::sqrt(std::max(0.0, squares / count - values.mean * values.mean));
  return values;
}

}  // namespace

struct GenerateSession::Work {
  Work(std::optional<ByteImage> shown, std::optional<ByteImage> covered,
       const GenerateOptions& given)
      : image(std::move(shown)),
        mask(std::move(covered)),
        networks(given),
        options(networks.adapted(given)) {
    if (options.matches_colours) differentiableDecoder(networks);
    // Nothing is followed where there is no image, and one call of the network is enough.
    if (!image) options.guidance = std::min(options.guidance, 1.0);
    status.steps = options.steps;
  }

  void run(Progress& progress);
  /// The state that a checkpoint keeps, or that of the noise.
  SamplerState firstState(const std::string& key, const GenerationNoise& noise);
  /// Those of another session, or the encoders'. In: end: of the encoders' part of the whole work.
  std::shared_ptr<const KeyedFeatures> featuresFor(const NetworkRun& run,
                                                   const PreparedImage& prepared,
                                                   const std::string& features_key, double end);
  /// Notes what passes by in the encoders: all of it, or their results alone.
  StageListener layerListener();
  FlowContext contextOf(const NetworkRun& run, const PreparedImage& prepared,
                        const ImageFeatures& image_features, std::span<const float> noise,
                        double end);
  void sample(const NetworkRun& run, const FlowContext& context, const std::string& key,
              SamplerState& state, const ProgressShare& share);
  void keep(const std::string& key, const SamplerState& state) const;
  void showPreview(const FlowPreview& preview, Progress& progress);
  /// In: weights: the decoder's, which the model's file names; settings, as JSON.
  std::shared_ptr<const SplatModel> modelOf(const Latent& latent, const WeightsReference& weights,
                                            const std::string& settings) const;
  /// The splats of a preview.
  SplatCloud decoded(const SplatModel& model, Progress& progress, double begin, double end) const;
  /// Of the whole work, what ends with the last step.
  double sampledShare() const {
    return options.matches_colours ? kSampledBeforeMatching : kSampledShare;
  }
  /// In: prepared: empty where there is no image; settings, as JSON.
  void finish(Latent latent, const PreparedImage& prepared, std::string settings,
              Progress& progress);

  void note(const std::string& name, std::span<const float> numbers, double operations = 0) {
    StageValues values = valuesOf(name, numbers);
    values.operations = operations;
    const std::lock_guard<std::mutex> lock(mutex);
    values.seconds = watch.lap();
    stages.push_back(std::move(values));
    status.stage_count = stages.size();
  }
  /// In: first: the step that this run began with.
  void finishStep(uint32_t step, uint32_t first) {
    const std::lock_guard<std::mutex> lock(mutex);
    status.step = step;
    const double each = step_watch.seconds() / std::max(1u, step - first);
    status.seconds_left = each * (status.steps - step);
  }

  std::optional<ByteImage> image;
  std::optional<ByteImage> mask;
  Networks networks;
  GenerateOptions options;                         ///< as the networks take them
  std::shared_ptr<const BackendFactory> backends;  ///< null: likeness is not measured
  Stopwatch watch, step_watch;
  std::shared_ptr<const SplatModel> result;

  mutable std::mutex mutex;  ///< of what follows
  GenerateStatus status;
  std::deque<StageValues> stages;            ///< they stay where they are
  std::shared_ptr<const SplatCloud> newest;  ///< preview, until it is taken
  std::shared_ptr<const KeyedFeatures> features;
};

GenerateSession::GenerateSession(std::optional<ByteImage> image, std::optional<ByteImage> mask,
                                 const GenerateOptions& options,
                                 std::shared_ptr<const BackendFactory> backends) {
  requireOptions(options);
  if (image) requireByteImage(*image, "The image");
  if (mask && !image) {
    fail(ErrorCode::kInvalidArgument, "there is a mask and no image that it belongs to");
  }
  if (options.matches_colours && (!image || !backends)) {
    fail(ErrorCode::kInvalidArgument, "colours are matched to an image, and there is none");
  }
  if (!options.checkpoint_path.empty()) requireCheckpointPlace(options.checkpoint_path);
  work_ = std::make_unique<Work>(std::move(image), std::move(mask), options);
  if (work_->image) work_->backends = std::move(backends);
}

GenerateSession::~GenerateSession() = default;

void GenerateSession::takeFeatures(const GenerateSession& other) {
  std::shared_ptr<const KeyedFeatures> taken;
  {
    const std::lock_guard<std::mutex> lock(other.work_->mutex);
    taken = other.work_->features;
  }
  const std::lock_guard<std::mutex> lock(work_->mutex);
  work_->features = std::move(taken);
}

uint64_t GenerateSession::memoryBound() const {
  return workBytes(work_->networks, work_->options);
}

GenerateEstimate GenerateSession::estimate(const GenerateOptions& given) {
  requireOptions(given);
  const Networks networks(given);
  const GenerateOptions options = networks.adapted(given);
  const StageCost sampling = networks.samplingCost(options);
  const double encoding = networks.encoderWork(options.preparation.canvas_size);
  const MachineSpeed& speed = machineSpeed();
  GenerateEstimate estimate;
  estimate.operations = encoding + sampling.flops;
  estimate.image_seconds = encoding / speed.products;
  estimate.seconds = estimate.image_seconds +
                     (sampling.flops - sampling.attention_flops) / speed.products +
                     sampling.attention_flops / speed.attention;
  if (options.matches_colours) {
    const double matching =
        matchingOperations(differentiableDecoder(networks), options.preview_anchors);
    estimate.operations += matching;
    estimate.seconds += matching / speed.products;
  }
  estimate.bytes = workBytes(networks, options);
  for (const WeightsFile& file : networks.folder.files) estimate.weight_bytes += file.bytes;
  return estimate;
}

std::shared_ptr<const SplatModel> GenerateSession::Work::modelOf(
    const Latent& latent, const WeightsReference& weights, const std::string& settings) const {
  return makeLatentSplats(networks.decoder, std::make_shared<const Latent>(latent), weights,
                          {settings, {}});
}

SplatCloud GenerateSession::Work::decoded(const SplatModel& model, Progress& progress, double begin,
                                          double end) const {
  const ModelSettings allowed = model.settings();
  ModelRequest request;
  request.budget =
      std::clamp(options.preview_anchors, allowed.minimum_budget, allowed.maximum_budget);
  return model.decode(request, &progress, begin, end);
}

SamplerState GenerateSession::Work::firstState(const std::string& key,
                                               const GenerationNoise& noise) {
  if (!options.checkpoint_path.empty() && std::filesystem::exists(options.checkpoint_path)) {
    const Checkpoint checkpoint = readCheckpoint(options.checkpoint_path);
    if (checkpoint.settings_json != key) {
      fail(ErrorCode::kInvalidArgument,
           "'" + options.checkpoint_path +
               "' keeps a generation of another image, or with other settings or weights; remove "
               "it, or choose another file");
    }
    SamplerState state = samplerOfTensors(checkpoint.tensors);
    const std::lock_guard<std::mutex> lock(mutex);
    status.step = status.resumed_step = state.step;
    return state;
  }
  return startSampling(networks.flow, options.token_count, noise, flowSettings(options));
}

void GenerateSession::Work::keep(const std::string& key, const SamplerState& state) const {
  if (options.checkpoint_path.empty()) return;
  writeCheckpoint(key, tensorsOfSampler(state), options.checkpoint_path);
}

void GenerateSession::Work::showPreview(const FlowPreview& preview, Progress& progress) {
  const double now = progress.fraction();
  auto cloud =
      std::make_shared<SplatCloud>(decoded(*modelOf(preview.latent, {}, "{}"), progress, now, now));
  if (options.size > 0) place(standingOnBase(*cloud, options.size), *cloud);
  const std::lock_guard<std::mutex> lock(mutex);
  newest = std::move(cloud);
  status.preview_step = preview.step;
}

void GenerateSession::Work::finish(Latent latent, const PreparedImage& prepared,
                                   std::string settings, Progress& progress) {
  SplatCloud cloud;
  if (options.size > 0 || backends) {
    cloud = decoded(*modelOf(latent, {}, settings), progress, sampledShare(),
                    options.matches_colours ? kDecodedShare : kMeasuredShare);
  }
  if (backends) {
    ImageLikeness found = imageLikeness(*backends, cloud, prepared, &progress);
    if (options.matches_colours && found.camera) {
      const DensityAutoencoder decoder = differentiableDecoder(networks);
      const std::vector<float> weights =
          decoder.layout().read(openWeightFile(networks.pathOf(WeightsRole::kDecoder)));
      matchColours(decoder, weights, options.preview_anchors, *backends, prepared, *found.camera,
                   latent, &progress, {kDecodedShare, kMeasuredShare});
      note("latent.matched", latent.tokens, matchingOperations(decoder, options.preview_anchors));
      settings.insert(settings.size() - 1, ",\"matched_colours\":1");
      cloud = decoded(*modelOf(latent, {}, settings), progress, kMeasuredShare, kMeasuredShare);
      found = imageLikeness(*backends, cloud, prepared, &progress);
    }
    const std::lock_guard<std::mutex> lock(mutex);
    status.likeness = found.psnr;
  }
  if (options.size > 0) {
    note("splats.positions", cloud.positions);
    note("splats.scales", cloud.scales);
    note("splats.opacities", cloud.opacities);
    note("splats.colours", cloud.sh);
    latent.placement = standingOnBase(cloud, options.size);
  }
  progress.enterPart(kMeasuredShare, 1);
  const std::string& path = networks.folder.of(WeightsRole::kDecoder).path;
  result = modelOf(latent, referenceOf(path, &progress), settings);
  progress.enterPart(0, 1);
}

void GenerateSession::run(Progress& progress) {
  work_->run(progress);
}

void GenerateSession::Work::run(Progress& progress) {
  const NetworkRun run = {.progress = &progress};
  progress.advance(0, "Preparing the image");
  const PreparedImage prepared =
      image ? prepareImage(*image, mask ? &*mask : nullptr, options.preparation) : PreparedImage();
  const std::string key = keyOf(networks, options, prepared);
  const std::vector<float> bytes(prepared.rgb.begin(), prepared.rgb.end());
  note("prepared", bytes);

  NoiseSizes sizes;
  const uint32_t size = options.preparation.canvas_size;
  sizes.colour = networks.encoders.noiseCount(size);
  sizes.tokens = options.token_count * networks.flow.sizes().token_width;
  GenerationNoise noise = drawNoise(sizes, options.noise);
  note("noise.colour", noise.colour);
  note("noise.tokens", noise.tokens);
  if (options.uses_mean_colour) noise.colour.clear();
  SamplerState state = firstState(key, noise);

  if (!image) {
    sample(run, networks.flow.emptyContext(run, networks.rows(options)), key, state,
           {kPreparationShare, sampledShare()});
    return finish(std::move(state.latent), prepared, key, progress);
  }
  const std::string features_key = featuresKeyOf(networks, options, prepared);
  if (features && features->key != features_key) features = nullptr;
  const double encoding = features ? 0 : networks.encoderWork(size);
  const double sampling = networks.samplingCost(options).flops;
  const double middle =
      kPreparationShare + (sampledShare() - kPreparationShare) * encoding / (encoding + sampling);
  const std::shared_ptr<const KeyedFeatures> found =
      featuresFor(run, prepared, features_key, middle);
  const FlowContext context = contextOf(run, prepared, found->features, noise.colour, middle);
  sample(run, context, key, state, {middle, sampledShare()});
  finish(std::move(state.latent), prepared, key, progress);
}

StageListener GenerateSession::Work::layerListener() {
  return [this](const std::string& stage, const StageNumbers& numbers) {
    const bool is_structure = stage == "structure.feature1", is_colour = stage == "colour.moments";
    if (!options.watches_layers && !is_structure && !is_colour) return;
    std::vector<float> rows(numbers.rows * numbers.width);
    for (size_t i = 0; i < numbers.rows; ++i) {
      const float* row = numbers.values + i * numbers.stride;
      std::copy(row, row + numbers.width, rows.begin() + static_cast<ptrdiff_t>(i * numbers.width));
    }
    const uint32_t size = options.preparation.canvas_size;
    if (is_structure) {
      note("structure.features", rows, networks.encoders.structureFlops(size));
    } else {
      note(stage, rows, is_colour ? networks.encoders.colourFlops(size) : 0);
    }
  };
}

std::shared_ptr<const KeyedFeatures> GenerateSession::Work::featuresFor(
    const NetworkRun& run, const PreparedImage& prepared, const std::string& features_key,
    double end) {
  if (features) {
    note("structure.features", features->features.structure);
    note("colour.moments", features->features.moments.values);
    return features;
  }
  auto found = std::make_shared<const KeyedFeatures>(KeyedFeatures{
      features_key,
      networks.encoders.features(run, prepared, {kPreparationShare, end}, layerListener())});
  const std::lock_guard<std::mutex> lock(mutex);
  features = found;
  return found;
}

FlowContext GenerateSession::Work::contextOf(const NetworkRun& run, const PreparedImage& prepared,
                                             const ImageFeatures& image_features,
                                             std::span<const float> noise, double end) {
  const StageListener listener = options.watches_layers ? layerListener() : StageListener();
  const ImageCondition condition =
      networks.encoders.condition(prepared, image_features, noise, listener);
  note("colour.features", condition.colour);
  FlowContext context = networks.flow.context(run, condition, {end, end});
  note("image.context", context.values,
       flowContextCost(networks.flow.sizes(), condition.rows).flops);
  return context;
}

void GenerateSession::Work::sample(const NetworkRun& run, const FlowContext& context,
                                   const std::string& key, SamplerState& state,
                                   const ProgressShare& share) {
  const uint32_t first = state.step;
  const double step_operations = networks.stepCost(options).flops;
  step_watch = {};
  FlowListener listener;
  listener.preview_every = 1;
  listener.preview = [&](const FlowPreview& preview) {
    const std::string name = "step" + std::to_string(preview.step);
    note(name + ".tokens", state.latent.tokens, step_operations);
    note(name + ".camera", state.latent.camera);
    finishStep(preview.step, first);
    keep(key, state);
    const uint32_t every = options.preview_steps;
    if (every > 0 && preview.step % every == 0) showPreview(preview, *run.progress);
  };
  try {
    sampleLatent(run, networks.flow, context, state, listener, share);
  } catch (const Error& error) {
    // Half a step is kept too: a call of the network takes minutes.
    if (error.code() == ErrorCode::kCancelled) keep(key, state);
    throw;
  }
  note("latent", state.latent.tokens, first < state.step ? step_operations : 0);
  note("camera", state.latent.camera);
  finishStep(state.step, first);
  keep(key, state);
}

GenerateStatus GenerateSession::status() const {
  const std::lock_guard<std::mutex> lock(work_->mutex);
  GenerateStatus status = work_->status;
  status.seconds = work_->watch.seconds();
  return status;
}

const StageValues& GenerateSession::stageAt(size_t index) const {
  const std::lock_guard<std::mutex> lock(work_->mutex);
  if (index >= work_->stages.size()) {
    fail(ErrorCode::kInvalidArgument, "index is " + std::to_string(index) + "; there are " +
                                          std::to_string(work_->stages.size()) + " stages so far");
  }
  return work_->stages[index];
}

std::shared_ptr<const SplatCloud> GenerateSession::takePreview() {
  const std::lock_guard<std::mutex> lock(work_->mutex);
  return std::exchange(work_->newest, nullptr);
}

std::shared_ptr<const SplatModel> GenerateSession::model() const {
  if (!work_->result) {
    fail(ErrorCode::kInvalidArgument, "this generation has not ended, or has not ended well");
  }
  return work_->result;
}

}  // namespace stipple
