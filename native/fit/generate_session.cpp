// Based on: the released pipeline of arXiv 2605.16355. Differs: all noise comes from one seed, work
// can be interrupted and continued, and previews are decoded on the way.
#include "fit/generate_session.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <span>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/number_text.h"
#include "base/stopwatch.h"
#include "fit/machine_speed.h"
#include "generate/dino_encoder.h"
#include "generate/flow_cost.h"
#include "generate/flow_network.h"
#include "generate/image_condition.h"
#include "generate/vae_encoder.h"
#include "io/assets/checkpoint.h"
#include "io/assets/weight_file.h"
#include "io/bytes/sha256.h"
#include "model/latent_splats.h"

namespace stipple {

namespace {

// Channels of the colour encoder's first level, whose maps are the largest that there are.
constexpr uint64_t kFirstColourChannels = 128;
// Of the whole work, what comes before the encoders and behind the last step.
constexpr double kPreparationShare = 0.01, kEndShare = 0.99;

/// The networks up to the latent. What is large stays in their files.
struct Networks {
  WeightsFolder folder;
  DinoEncoder structure;
  VaeEncoder colour;
  FlowNetwork flow;
  WeightTable decoder;

  explicit Networks(const GenerateOptions& options)
      : folder(findWeights(options.weights_folder)),
        structure(open(WeightsRole::kStructureEncoder), {options.structure_head_width}),
        colour(open(WeightsRole::kColourEncoder)),
        flow(open(WeightsRole::kFlow)),
        decoder(open(WeightsRole::kDecoder)) {
    const FlowSizes& sizes = flow.sizes();
    if (sizes.structure_width != structure.width() || sizes.colour_width != colour.tokenWidth()) {
      fail(ErrorCode::kFormat,
           "the files of weights do not fit together: the flow network takes features of " +
               std::to_string(sizes.structure_width) + " and " +
               std::to_string(sizes.colour_width) + " numbers, the encoders give " +
               std::to_string(structure.width()) + " and " + std::to_string(colour.tokenWidth()));
    }
  }

  WeightTable open(WeightsRole role) const {
    return openWeightFile(requireWeights(folder, role).path);
  }
  double encoderWork(uint32_t size) const {
    return structure.flops(size, size) + colour.flops(size, size);
  }
  StageCost samplingCost(const GenerateOptions& options) const {
    return flowSamplingCost(flow.sizes(), options.token_count, rows(options), options.flow);
  }
  uint64_t rows(const GenerateOptions& options) const {
    const uint32_t size = options.preparation.canvas_size;
    return structure.rowsFor(size, size);
  }
};

void requireOptions(const GenerateOptions& options) {
  validate(options.flow);
  requirePreparation(options.preparation);
  if (options.token_count == 0 || options.token_count > kMostFlowTokens) {
    fail(ErrorCode::kInvalidArgument, "the number of tokens is " +
                                          std::to_string(options.token_count) + "; 1 to " +
                                          std::to_string(kMostFlowTokens) + " is allowed");
  }
  if (options.preview_steps > 0 && options.preview_anchors == 0) {
    fail(ErrorCode::kInvalidArgument, "the anchors of a preview are 0; 1 or more is allowed");
  }
}

/// Encoders work one after the other, and their memory is free before the flow network begins.
uint64_t workBytes(const Networks& networks, const GenerateOptions& options) {
  const uint64_t side = options.preparation.canvas_size, rows = networks.rows(options);
  const uint64_t width = networks.structure.width();
  constexpr uint64_t kInner = 4;  // how much wider than tokens the MLPs of image encoders are
  const uint64_t structure = rows * (2 + 2 * kInner) * width * sizeof(float);
  const uint64_t colour = 2 * side * side * kFirstColourChannels * sizeof(float);
  const uint64_t condition = rows * (width + networks.colour.tokenWidth()) * sizeof(float);
  const uint64_t flow = networks.flow.memoryBound(options.token_count, rows);
  return condition + std::max({structure, colour, flow});
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
                    ",\"steps\":" + text(options.flow.steps) +
                    ",\"guidance\":" + numberText(options.flow.guidance) +
                    ",\"shift\":" + numberText(options.flow.shift) + ",\"weights\":[";
  for (const WeightsFile& file : networks.folder.files) {
    key += (key.back() == '[' ? "" : ",") + text(file.bytes);
  }
  return key + "]}";
}

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
  Work(ByteImage shown, std::optional<ByteImage> covered, const GenerateOptions& options)
      : image(std::move(shown)), mask(std::move(covered)), networks(options) {
    status.steps = options.flow.steps;
  }

  void note(const std::string& name, std::span<const float> numbers) {
    StageValues values = valuesOf(name, numbers);
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

  ByteImage image;
  std::optional<ByteImage> mask;
  Networks networks;
  Stopwatch watch, step_watch;
  std::shared_ptr<const SplatModel> model;

  mutable std::mutex mutex;  ///< of what follows
  GenerateStatus status;
  std::deque<StageValues> stages;  ///< they stay where they are
  std::shared_ptr<const SplatCloud> preview;
};

GenerateSession::GenerateSession(ByteImage image, std::optional<ByteImage> mask,
                                 const GenerateOptions& options)
    : options_(options) {
  requireOptions(options_);
  requireByteImage(image, "the image");
  if (!options_.checkpoint_path.empty()) requireCheckpointPlace(options_.checkpoint_path);
  work_ = std::make_unique<Work>(std::move(image), std::move(mask), options_);
}

GenerateSession::~GenerateSession() = default;

uint64_t GenerateSession::memoryBound() const {
  return workBytes(work_->networks, options_);
}

GenerateEstimate GenerateSession::estimate(const GenerateOptions& options) {
  requireOptions(options);
  const Networks networks(options);
  const StageCost sampling = networks.samplingCost(options);
  const double encoding = networks.encoderWork(options.preparation.canvas_size);
  const MachineSpeed& speed = machineSpeed();
  GenerateEstimate estimate;
  estimate.operations = encoding + sampling.flops;
  estimate.seconds = (encoding + sampling.flops - sampling.attention_flops) / speed.products +
                     sampling.attention_flops / speed.attention;
  estimate.bytes = workBytes(networks, options);
  for (const WeightsFile& file : networks.folder.files) estimate.weight_bytes += file.bytes;
  return estimate;
}

std::shared_ptr<const SplatModel> GenerateSession::modelOf(const Latent& latent,
                                                           const std::string& settings) const {
  return makeLatentSplats(latent, work_->networks.folder.of(WeightsRole::kDecoder).path, settings);
}

SamplerState GenerateSession::firstState(const std::string& key, const GenerationNoise& noise) {
  Work& work = *work_;
  if (!options_.checkpoint_path.empty() && std::filesystem::exists(options_.checkpoint_path)) {
    const Checkpoint checkpoint = readCheckpoint(options_.checkpoint_path);
    if (checkpoint.settings_json != key) {
      fail(ErrorCode::kInvalidArgument,
           "'" + options_.checkpoint_path +
               "' keeps a generation of another image, or with other settings or weights; remove "
               "it, or choose another file");
    }
    SamplerState state = samplerOfTensors(checkpoint.tensors);
    const std::lock_guard<std::mutex> lock(work.mutex);
    work.status.step = work.status.resumed_step = state.step;
    return state;
  }
  return startSampling(work.networks.flow, options_.token_count, noise, options_.flow);
}

void GenerateSession::keep(const std::string& key, const SamplerState& state) const {
  if (options_.checkpoint_path.empty()) return;
  writeCheckpoint(key, tensorsOfSampler(state), options_.checkpoint_path);
}

void GenerateSession::showPreview(const FlowPreview& preview) {
  Work& work = *work_;
  ModelRequest request;
  request.budget = options_.preview_anchors;
  const std::shared_ptr<const SplatModel> model = modelOf(preview.latent, "{}");
  auto cloud = std::make_shared<const SplatCloud>(model->decode(request));
  const std::lock_guard<std::mutex> lock(work.mutex);
  work.preview = std::move(cloud);
  work.status.preview_step = preview.step;
}

void GenerateSession::run(Progress& progress) {
  Work& work = *work_;
  const NetworkRun run = {.progress = &progress};
  progress.advance(0, "Preparing the image");
  const PreparedImage prepared =
      prepareImage(work.image, work.mask ? &*work.mask : nullptr, options_.preparation);
  const std::string key = keyOf(work.networks, options_, prepared);
  const std::vector<float> bytes(prepared.rgb.begin(), prepared.rgb.end());
  work.note("prepared", bytes);

  NoiseSizes sizes;
  const uint32_t size = options_.preparation.canvas_size;
  sizes.colour = work.networks.colour.noiseCount(size, size);
  sizes.tokens = options_.token_count * work.networks.flow.sizes().token_width;
  GenerationNoise noise = drawNoise(sizes, options_.noise);
  work.note("noise.colour", noise.colour);
  work.note("noise.tokens", noise.tokens);
  if (options_.uses_mean_colour) noise.colour.clear();
  SamplerState state = firstState(key, noise);

  const double encoding = work.networks.encoderWork(size);
  const double sampling = work.networks.samplingCost(options_).flops;
  const double middle =
      kPreparationShare + (kEndShare - kPreparationShare) * encoding / (encoding + sampling);
  const FlowContext context = contextOf(run, prepared, noise.colour, middle);
  sample(run, context, key, state, {middle, kEndShare});
  progress.advance(kEndShare, "Reading the decoder");
  work.note("latent", state.latent.tokens);
  work.note("camera", state.latent.camera);
  work.model = modelOf(state.latent, key);
}

FlowContext GenerateSession::contextOf(const NetworkRun& run, const PreparedImage& prepared,
                                       std::span<const float> noise, double end) {
  Work& work = *work_;
  StageListener listener;
  std::vector<float> rows;
  if (options_.watches_layers) {
    listener = [&](const std::string& stage, const StageNumbers& numbers) {
      rows.resize(numbers.rows * numbers.width);
      for (size_t i = 0; i < numbers.rows; ++i) {
        const float* row = numbers.values + i * numbers.stride;
        std::copy(row, row + numbers.width,
                  rows.begin() + static_cast<ptrdiff_t>(i * numbers.width));
      }
      work.note(stage, rows);
    };
  }
  const ImageCondition condition = encodeImage(run, work.networks.structure, work.networks.colour,
                                               prepared, noise, {kPreparationShare, end}, listener);
  work.note("structure", condition.structure);
  work.note("colour", condition.colour);
  return work.networks.flow.context(run, condition, {end, end});
}

void GenerateSession::sample(const NetworkRun& run, const FlowContext& context,
                             const std::string& key, SamplerState& state,
                             const ProgressShare& share) {
  Work& work = *work_;
  const uint32_t first = state.step;
  work.step_watch = {};
  FlowListener listener;
  listener.preview_every = 1;
  listener.preview = [&](const FlowPreview& preview) {
    const std::string name = "step" + std::to_string(preview.step);
    work.note(name + ".tokens", state.latent.tokens);
    work.note(name + ".camera", state.latent.camera);
    work.finishStep(preview.step, first);
    keep(key, state);
    const uint32_t every = options_.preview_steps;
    if (every > 0 && preview.step % every == 0) showPreview(preview);
  };
  try {
    sampleLatent(run, work.networks.flow, context, state, listener, share);
  } catch (const Error& error) {
    // Half a step is kept too: a call of the network takes minutes.
    if (error.code() == ErrorCode::kCancelled) keep(key, state);
    throw;
  }
  work.finishStep(state.step, first);
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
  return std::exchange(work_->preview, nullptr);
}

std::shared_ptr<const SplatModel> GenerateSession::model() const {
  if (!work_->model) {
    fail(ErrorCode::kInvalidArgument, "this generation has not ended, or has not ended well");
  }
  return work_->model;
}

}  // namespace stipple
