#include <memory>
#include <optional>

#include "cli/commands.h"
#include "cli/dataset.h"
#include "cli/jobs/replaced_splats.h"
#include "cli/numbers.h"

namespace stipple::cli {

namespace {

struct Arguments {
  std::string in, out, dataset, strategy = "adaptive";
  std::optional<int64_t> max_splats;
  int64_t events = 1;
  int64_t downscale = 1;
  int64_t holdout = 0;
  uint64_t seed = 0;
  double image_mib = 1024;
};

void densify(const Context& context, const Arguments& arguments) {
  requireSplats(arguments.out);
  StippleDensifyOptions options;
  stipple_densify_options_init(&options);
  options.strategy_utf8 = arguments.strategy.c_str();
  if (arguments.max_splats) {
    options.max_splats = counted(*arguments.max_splats, "--max-splats");
  }
  options.event_count = counted32(arguments.events, "--events");
  options.holdout = counted32(arguments.holdout, "--holdout", 0);
  options.seed = arguments.seed;
  options.image_bytes = bytesOfMebibytes(arguments.image_mib);
  const auto cloud = make<Cloud>(stipple_cloud_load, context.get(), arguments.in.c_str());
  const Views views = openViews(context, arguments.dataset, arguments.downscale);
  const auto job =
      make<Job>(stipple_densify_start, context.get(), const_cast<const StippleCloud*>(cloud.get()),
                const_cast<const StippleViews*>(views.get()),
                const_cast<const StippleDensifyOptions*>(&options));
  finish(job);
  saveReplaced(job, cloud, arguments.out, false);
}

}  // namespace

void addDensify(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  Arguments& to = *arguments;
  CLI::App* command = app.add_subcommand(
      "densify", "Splits, copies and removes splats where images ask for it; nothing is trained");
  command->add_option("in", to.in, "Splats")->required();
  command->add_option("out", to.out, "Splats (.ply and others)")->required();
  command
      ->add_option("--dataset", to.dataset,
                   "COLMAP folder, or transforms.json or its folder, with the images")
      ->required();
  command->add_option("--strategy", to.strategy, "How splats are added and removed")
      ->capture_default_str();
  command->add_option("--max-splats,--gaussians", to.max_splats,
                      "Maximum number of splats; default: twice as many as there are");
  command->add_option("--events", to.events, "How often splats multiply and go")
      ->capture_default_str();
  command->add_option("--downscale", to.downscale, "Images are made smaller by this factor")
      ->capture_default_str();
  command->add_option("--holdout", to.holdout, "Every N-th view is left out; 0: none")
      ->capture_default_str();
  command
      ->add_option("--image-memory,--picture-memory", to.image_mib,
                   "MiB of images that are kept; others are read again whenever they are wanted")
      ->capture_default_str();
  command->add_option("--seed", to.seed)->capture_default_str();
  command->callback([arguments, &context] { densify(context, *arguments); });
}

}  // namespace stipple::cli
