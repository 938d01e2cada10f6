#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "cli/commands.h"
#include "cli/networks/save_model.h"
#include "cli/numbers.h"
#include "cli/report.h"

namespace stipple::cli {

namespace {

struct Arguments {
  std::string weights, object, out;
  int64_t tokens = 0;
  std::optional<int64_t> anchors;
  bool json = false;
};

void encode(const Context& context, const Arguments& arguments) {
  const auto start = std::chrono::steady_clock::now();
  requireModelOrSplats(arguments.out);
  const auto job = make<Job>(stipple_encode_start, context.get(), arguments.weights.c_str(),
                             arguments.object.c_str(), counted32(arguments.tokens, "--tokens", 0));
  finish(job);
  Report report;
  saveModelOf(job, arguments.out, arguments.anchors, "", report);
  report.add("seconds", secondsSince(start));
  report.print(arguments.json);
}

}  // namespace

void addEncode(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  Arguments& to = *arguments;
  CLI::App* command = app.add_subcommand(
      "encode", "An object to a latent or splats, by networks that 'stipple train' has learned");
  command->add_option("weights", to.weights, "weights.safetensors of a training")->required();
  command
      ->add_option("object", to.object,
                   "Folder of an object as collections have them, or a .ply of points with colours")
      ->required();
  command
      ->add_option("out", to.out,
                   "The latent as a model (.stipple.safetensors), or splats (.ply and others)")
      ->required();
  command->add_option("--tokens", to.tokens, "Size of the latent; 0: as many as were learned")
      ->capture_default_str();
  command->add_option("--anchors", to.anchors, "Splats: anchors, each of which becomes several");
  command->add_flag("--json", to.json, "Figures as JSON");
  command->callback([arguments, &context] { encode(context, *arguments); });
}

}  // namespace stipple::cli
