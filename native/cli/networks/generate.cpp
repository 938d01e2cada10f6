#include <chrono>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>

#include "cli/commands.h"
#include "cli/networks/save_model.h"
#include "cli/networks/weights_report.h"
#include "cli/numbers.h"
#include "cli/report.h"

namespace stipple::cli {

namespace {

struct Arguments {
  std::string image, out, weights, mask, checkpoint, seed_mode = "keyed";
  uint64_t seed = 42;
  int64_t steps = 20, tokens = 8192, canvas = 1024, erode = 1, seeds = 1;
  double guidance = 3.0, shift = 3.0, size = 1.0;
  std::optional<int64_t> anchors;
  bool is_random = false;  ///< no image tells of the object
  bool keeps_best = false, matches_colours = false;
  bool mean_colour = false, check = false, timings = false, estimate = false, json = false;
};

StippleGenerateOptions optionsOf(const Arguments& arguments) {
  StippleGenerateOptions options;
  stipple_generate_options_init(&options);
  if (!arguments.weights.empty()) options.weights_folder_utf8 = arguments.weights.c_str();
  if (!arguments.checkpoint.empty()) options.checkpoint_path_utf8 = arguments.checkpoint.c_str();
  options.steps = counted32(arguments.steps, "--steps");
  options.token_count = counted32(arguments.tokens, "--tokens");
  options.canvas_size = counted32(arguments.canvas, "--canvas");
  options.erode_radius = counted32(arguments.erode, "--erode", 0);
  options.noise_source =
      arguments.seed_mode == "torch-cpu" ? STIPPLE_NOISE_TORCH_CPU : STIPPLE_NOISE_KEYED;
  options.uses_mean_colour = arguments.mean_colour ? 1 : 0;
  options.matches_colours = arguments.matches_colours ? 1 : 0;
  options.watches_layers = arguments.check ? 1 : 0;
  options.seed = arguments.seed;
  options.guidance = arguments.guidance;
  options.shift = arguments.shift;
  options.size = arguments.size;
  return options;
}

void addEstimate(const StippleGenerateEstimate& estimate, Report& report) {
  report.add("estimated_seconds", estimate.seconds);
  report.add("estimated_image_seconds", estimate.image_seconds);
  report.add("estimated_bytes", estimate.bytes);
  report.add("weight_bytes", estimate.weight_bytes);
  report.add("operations", estimate.operations);
}

/// What passed by in the networks, as a table for people, or among the figures.
/// In: prefix: of figures, which tells seeds apart; empty where there is one.
void addStages(const Job& job, const std::string& prefix, bool json, Report& report) {
  auto figures = sized<StippleGenerateFigures>();
  check(stipple_generate_figures(job.get(), &figures));
  if (!json) {
    std::printf("%-28s %12s %13s %13s %13s %13s %9s\n", "stage", "numbers", "minimum", "maximum",
                "mean", "deviation", "seconds");
  }
  for (uint32_t i = 0; i < figures.stage_count; ++i) {
    auto stage = sized<StippleGenerateStage>();
    check(stipple_generate_stage(job.get(), i, &stage));
    const std::string name = prefix + stage.name_utf8;
    if (!json) {
      std::printf("%-28s %12llu %13.6g %13.6g %13.6g %13.6g %9.3f\n", stage.name_utf8,
                  static_cast<unsigned long long>(stage.count), stage.minimum, stage.maximum,
                  stage.mean, stage.deviation, stage.seconds);
      continue;
    }
    report.add(name + ".count", stage.count);
    report.add(name + ".minimum", stage.minimum);
    report.add(name + ".maximum", stage.maximum);
    report.add(name + ".mean", stage.mean);
    report.add(name + ".deviation", stage.deviation);
    report.add(name + ".seconds", stage.seconds);
  }
}

/// Seconds and operations of what passed by.
void addTimings(const Job& job, const std::string& prefix, double decode_seconds, bool json,
                Report& report) {
  auto figures = sized<StippleGenerateFigures>();
  check(stipple_generate_figures(job.get(), &figures));
  const auto line = [](const char* name, double seconds, double operations) {
    std::printf("%-28s %9.3f s", name, seconds);
    if (operations > 0) {
      std::printf(" %9.4f TFLOP %7.1f GFLOP/s", operations * 1e-12, operations * 1e-9 / seconds);
    }
    std::printf("\n");
  };
  for (uint32_t i = 0; i < figures.stage_count; ++i) {
    auto stage = sized<StippleGenerateStage>();
    check(stipple_generate_stage(job.get(), i, &stage));
    const std::string name = prefix + stage.name_utf8;
    if (!json) {
      line(stage.name_utf8, stage.seconds, stage.operations);
      continue;
    }
    report.add(name + ".seconds", stage.seconds);
    report.add(name + ".operations", stage.operations);
  }
  if (json) return report.add(prefix + "decoding.seconds", decode_seconds);
  if (decode_seconds > 0) line("decoding", decode_seconds, 0);
}

/// A path with the seed behind its name: "chair_43.ply" of "chair.ply".
std::string withSeed(const std::string& path, uint64_t seed) {
  const size_t folder = path.find_last_of('/') + 1;  // 0 where there is none
  const size_t end = path.find('.', folder + 1);
  const size_t at = end == std::string::npos ? path.size() : end;
  return path.substr(0, at) + "_" + std::to_string(seed) + path.substr(at);
}

/// Where the state of a seed is kept; empty: nowhere.
std::string checkpointOf(const Arguments& arguments, uint64_t seed) {
  const std::string& path = arguments.checkpoint;
  return arguments.seeds == 1 || path.empty() ? path : withSeed(path, seed);
}

struct Pictures {
  Image image, mask;
};

/// One seed on its way.
struct Seeded {
  uint64_t seed = 0;
  Job job;
  double likeness = std::numeric_limits<double>::quiet_NaN();
};

/// In: before: the job of another seed, or null; is_last: of the seeds one was chosen, and this is
/// made of it.
Seeded generated(const Context& context, const Pictures& pictures, const Arguments& arguments,
                 uint64_t seed, const Job& before, bool is_last, Report& report) {
  const bool is_one = arguments.seeds == 1;
  const std::string prefix = is_last ? "best." : is_one ? "" : "seed" + std::to_string(seed) + ".";
  const std::string checkpoint = checkpointOf(arguments, seed);
  StippleGenerateOptions options = optionsOf(arguments);
  options.seed = seed;
  options.encoded_by = before.get();
  options.measures_likeness = is_one || arguments.is_random ? 0 : 1;
  // Seeds are compared as they are: by matched ones a wrong shape is told less well.
  if (arguments.keeps_best && !is_one && !is_last) options.matches_colours = 0;
  if (!checkpoint.empty()) options.checkpoint_path_utf8 = checkpoint.c_str();
  auto job = make<Job>(stipple_generate_start, context.get(),
                       const_cast<const StippleImage*>(pictures.image.get()),
                       const_cast<const StippleImage*>(pictures.mask.get()), &options);
  finish(job);
  auto figures = sized<StippleGenerateFigures>();
  check(stipple_generate_figures(job.get(), &figures));
  if (options.measures_likeness || options.matches_colours)
    report.add(prefix + "likeness_db", figures.likeness);
  double decode_seconds = 0;
  if (!arguments.keeps_best) {
    const std::string out = is_one ? arguments.out : withSeed(arguments.out, seed);
    decode_seconds = saveModelOf(job, out, arguments.anchors, prefix, report);
  }
  std::error_code ignored;
  // Of several of which one is kept, those before would begin anew if this one stopped.
  if (!checkpoint.empty() && !arguments.keeps_best) std::filesystem::remove(checkpoint, ignored);
  if (arguments.check) addStages(job, prefix, arguments.json, report);
  if (arguments.timings) addTimings(job, prefix, decode_seconds, arguments.json, report);
  return {seed, std::move(job), figures.likeness};
}

void generate(const Context& context, const Arguments& arguments) {
  const auto start = std::chrono::steady_clock::now();
  const StippleGenerateOptions options = optionsOf(arguments);
  const int64_t seeds = counted32(arguments.seeds, "--seeds");
  Report report;
  auto estimate = sized<StippleGenerateEstimate>();
  check(stipple_generate_estimate(context.get(), &options, &estimate));
  if (arguments.is_random) {
    estimate.seconds -= estimate.image_seconds;
    estimate.image_seconds = 0;
  }
  if (arguments.check) addWeights(context, arguments.weights, arguments.json, report);
  addEstimate(estimate, report);
  if (arguments.estimate) return report.print(arguments.json);
  if (arguments.out.empty()) throw Failure("out is missing; splats or a model is expected");
  requireModelOrSplats(arguments.out);
  Pictures pictures;
  if (!arguments.image.empty()) {
    pictures.image = make<Image>(stipple_image_load, context.get(), arguments.image.c_str());
  }
  if (!arguments.mask.empty()) {
    pictures.mask = make<Image>(stipple_image_load, context.get(), arguments.mask.c_str());
  }
  std::fprintf(stderr, "about %.0f s and %.0f MiB of memory on this machine\n",
               estimate.image_seconds +
                   static_cast<double>(seeds) * (estimate.seconds - estimate.image_seconds),
               static_cast<double>(estimate.bytes) / (1 << 20));
  Seeded best, last;
  for (int64_t i = 0; i < seeds; ++i) {
    Seeded made = generated(context, pictures, arguments, arguments.seed + static_cast<uint64_t>(i),
                            last.job ? last.job : best.job, false, report);
    // The first of those that are alike.
    const bool is_better = i == 0 || made.likeness > best.likeness;
    (is_better ? best : last) = std::move(made);
  }
  if (arguments.keeps_best) {
    report.add("best_seed", best.seed);
    if (arguments.matches_colours && seeds > 1) {
      best = generated(context, pictures, arguments, best.seed, best.job, true, report);
    }
    saveModelOf(best.job, arguments.out, arguments.anchors, "", report);
    for (int64_t i = 0; i < seeds && !arguments.checkpoint.empty(); ++i) {
      std::error_code ignored;
      std::filesystem::remove(checkpointOf(arguments, arguments.seed + static_cast<uint64_t>(i)),
                              ignored);
    }
  }
  report.add("seconds", secondsSince(start));
  report.print(arguments.json);
}

/// What images and seeds have in common. In: command, to, which must outlive it.
void addSettings(CLI::App* command, Arguments& to) {
  command->add_option("--weights", to.weights,
                      "Folder with the files of weights; default: that of the tool's --weights");
  command->add_option("--seed", to.seed)->capture_default_str();
  command
      ->add_option("--seeds", to.seeds,
                   "How many, from --seed on: each writes a file of its own, with the seed in its "
                   "name. The image is encoded once")
      ->capture_default_str();
  command
      ->add_option("--seed-mode", to.seed_mode,
                   "keyed, the same everywhere; or torch-cpu, PyTorch's noise on a CPU")
      ->check(CLI::IsMember({"keyed", "torch-cpu"}))
      ->capture_default_str();
  command->add_option("--steps", to.steps, "From noise to the object")->capture_default_str();
  command->add_option("--shift", to.shift, "Above 1: more steps where there is much noise")
      ->capture_default_str();
  command->add_option("--tokens", to.tokens, "Size of the latent")->capture_default_str();
  command
      ->add_option("--size", to.size,
                   "Metres of the largest side; 0: as the networks have it, around the origin")
      ->capture_default_str();
  command->add_option("--anchors", to.anchors, "Splats: anchors, each of which becomes several");
  command->add_option(
      "--checkpoint", to.checkpoint,
      "File that keeps the state after every step; the same command goes on from it");
  command->add_flag("--check", to.check,
                    "Says for a report whether the files are those published, and what passes by "
                    "in every layer");
  command->add_flag("--timings", to.timings, "Seconds and operations of each stage");
  command->add_flag("--estimate", to.estimate, "Only says what it would take");
  command->add_flag("--json", to.json, "Figures as JSON");
}

void addCommand(CLI::App* command, const std::shared_ptr<Arguments>& arguments,
                const Context& context) {
  command->callback([arguments, &context] { generate(context, *arguments); });
}

}  // namespace

void addGenerate(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  Arguments& to = *arguments;
  CLI::App* command = app.add_subcommand("generate",
                                         "An image to splats, by networks whose weights you "
                                         "download (docs/images_to_splats.md) or train "
                                         "(docs/training.md)");
  command->add_option("image", to.image, "Image with alpha, or any with --mask")->required();
  command->add_option("out", to.out,
                      "The latent as a model (.stipple.safetensors), or splats (.ply and others)");
  command->add_option("--mask", to.mask, "Image that is white, or opaque, on the object");
  command->add_option("--guidance", to.guidance, "How closely the image is followed")
      ->capture_default_str();
  command->add_option("--canvas", to.canvas, "Pixels of the image that networks see")
      ->capture_default_str();
  command->add_option("--erode", to.erode, "Pixels that the mask shrinks by")
      ->capture_default_str();
  command->add_flag("--keep-best", to.keeps_best,
                    "Of the seeds, only the one whose object looks most like the image is written");
  command->add_flag("--match-colours", to.matches_colours,
                    "Lead the colours closer to the image; with networks of 'stipple train' alone");
  command->add_flag("--mean-colour", to.mean_colour, "No noise on the colours of the image");
  addSettings(command, to);
  addCommand(command, arguments, context);
}

void addRandom(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  arguments->is_random = true;
  arguments->guidance = 1.0;  // There is nothing to follow, and each step is one call.
  CLI::App* command = app.add_subcommand(
      "random", "Splats of an object that only the seed tells of, by the networks of 'generate'");
  command->add_option("out", arguments->out,
                      "The latent as a model (.stipple.safetensors), or splats (.ply and others)");
  addSettings(command, *arguments);
  addCommand(command, arguments, context);
}

}  // namespace stipple::cli
