#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "fit/training/collection.h"
#include "generate/patch_condition.h"
#include "nn/network_run.h"
#include "train/detail/detail_trainer.h"
#include "train/networks/autoencoder_trainer.h"
#include "train/networks/flow_trainer.h"

namespace stipple {

/// What a training of the flow network does, once the autoencoder is done.
struct FlowConfig {
  std::string start;        ///< a trained flow that this one begins with; may be empty
  bool says_sizes = false;  ///< in its text: what `start` has a say in
  size_t heads = 4, head_width = 32, mlp_ratio = 4, rotary_width = 16;
  size_t blocks = 4, noise_refiners = 1, context_refiners = 2;
  FlowSchedule schedule;  ///< its total_steps are 0 where no flow is learned
  PatchSizes patches;
  uint32_t in_order = 1;  ///< 0: tokens stay in the order in which they were found

  bool isWanted() const { return schedule.optimiser.total_steps > 0; }
};

/// What a training of a network that adds detail to splats does. It is a training of its own.
struct DetailConfig {
  DetailModelSizes sizes;
  DetailSchedule schedule;
  uint64_t fit_steps = 400;    ///< of the splats that stand for an object without a coarse.ply
  uint64_t fit_splats = 4096;  ///< of them, at most
};

/// Sizes of the network that learns latents of that width. Errors: kInvalidArgument.
FlowSizes flowSizes(const FlowConfig& config, size_t latent_width);

/// What a training does: of the density autoencoder, and of a flow; or of detail.
struct TrainingConfig {
  std::string collection;  ///< folder
  std::string out;         ///< folder of all that it writes; made where it is not there
  std::string start;       ///< weights of another training that this one begins with; may be empty
  std::string latents;     ///< latentsOf() the start where this training keeps its encoder
  bool says_parts = false, says_network = false;  ///< in its text
  bool says_spacing = false;  ///< whether lengths follow the spacing, which says_network leaves out
  bool learns_detail = false;  ///< the text has "detail", and neither of them
  /// Of the factors of products in blocks of networks; all else is float32.
  FactorPrecision precision = FactorPrecision::kFloat32;
  uint64_t seed = 1;
  uint64_t held_out = 8;  ///< every so-many-th object judges and is not learned from; 0: none
  uint64_t measured_objects = 16;      ///< of those, at most, while it runs
  uint64_t measure_interval = 500;     ///< steps
  uint64_t checkpoint_interval = 250;  ///< steps
  CollectionOptions objects;
  AutoencoderSizes sizes;
  std::vector<AutoencoderSchedule> parts;  ///< none where detail is learned
  FlowConfig flow;
  DetailConfig detail;
};

/// What a config without "parts" and "network" says: the small networks, in three parts.
TrainingConfig defaultTrainingConfig();

/// Reads a JSON text. In: name: what messages call it; folder: that relative paths begin at.
/// Errors: kFormat for a text that is no JSON object; kInvalidArgument for a key that is not known,
/// with the nearest one that is, for a value of another type or out of range, with its key, and
/// where "collection" or "out" is missing.
TrainingConfig parseTrainingConfig(const std::string& text, const std::string& name,
                                   const std::string& folder);

/// Takes the networks of trained weights, and their parts where the config says none: then these
/// are done, and the flow alone is learned. Whether lengths follow the spacing may be said anew
/// where there are parts that learn it. In: settings: of the metadata of config.start. Errors:
/// kInvalidArgument where the config says other networks, or there is nothing left to learn; those
/// of readSettings().
void takeStart(const std::string& settings, TrainingConfig& config);

/// Takes the sizes of a trained flow that this one begins with, and how it sees images and tokens.
/// In: settings: of the metadata of config.flow.start, whose latents the caller has compared.
/// Errors: kInvalidArgument where the config says sizes itself, or learns no flow; those of
/// readSettings().
void takeFlowStart(const std::string& settings, TrainingConfig& config);

/// All settings that the weights depend on, as a flat JSON object: what a checkpoint must agree in.
std::string settingsJson(const TrainingConfig& config);

/// The other way round: of the metadata of trained weights. Out: collection and out are empty.
/// In: name, what messages call the text. Errors: as parseTrainingConfig().
TrainingConfig readSettings(const std::string& settings, const std::string& name);

/// The first of them that two trainings differ in, as "part.0.batch is 2, the checkpoint has 4";
/// empty where there is none. In: both of settingsJson().
std::string firstDifference(const std::string& settings, const std::string& of_checkpoint);

/// "structure", "attributes", "joint".
const char* stageName(AutoencoderStage stage);

}  // namespace stipple
