#include <memory>
#include <optional>

#include "cli/commands.h"
#include "cli/dataset.h"
#include "cli/jobs/replaced_splats.h"
#include "cli/numbers.h"

namespace stipple::cli {

namespace {

struct Arguments {
  std::string in, dataset, out, weights;
  std::optional<int64_t> splats, views;
  int64_t downscale = 1;
  bool json = false;
};

void addDetailTo(const Context& context, const Arguments& arguments) {
  requireSplats(arguments.out);
  StippleDetailOptions options;
  stipple_detail_options_init(&options);
  if (arguments.splats) options.max_splats = counted(*arguments.splats, "--splats");
  if (arguments.views) options.view_count = counted32(*arguments.views, "--views");
  const auto cloud = make<Cloud>(stipple_cloud_load, context.get(), arguments.in.c_str());
  const Views views = openViews(context, arguments.dataset, arguments.downscale);
  const auto job =
      make<Job>(stipple_detail_start, context.get(), const_cast<const StippleCloud*>(cloud.get()),
                const_cast<const StippleViews*>(views.get()), arguments.weights.c_str(),
                const_cast<const StippleDetailOptions*>(&options));
  finish(job);
  saveReplaced(job, cloud, arguments.out, arguments.json);
}

}  // namespace

void addDetail(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  Arguments& to = *arguments;
  CLI::App* command = app.add_subcommand(
      "detail", "Adds detail that images show to coarse splats, in one pass of a trained network");
  command->add_option("splats", to.in, "Coarse splats")->required();
  command
      ->add_option("dataset", to.dataset,
                   "COLMAP folder, or transforms.json or its folder, with the images")
      ->required();
  command->add_option("out", to.out, "Splats (.ply and others)")->required();
  command
      ->add_option("--weights", to.weights,
                   "detail.safetensors of a training with \"detail\" (docs/training.md)")
      ->required();
  command->add_option("--splats", to.splats, "Maximum number of splats; default: all become finer");
  command->add_option("--views", to.views,
                      "Images that are looked at, spread evenly; default: as many as in training");
  command->add_option("--downscale", to.downscale, "Images are made smaller by this factor")
      ->capture_default_str();
  command->add_flag("--json", to.json, "Figures as JSON");
  command->callback([arguments, &context] { addDetailTo(context, *arguments); });
}

}  // namespace stipple::cli
