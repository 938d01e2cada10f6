#include <memory>
#include <string>

#include "cli/commands.h"

namespace stipple::cli {

void addShrink(CLI::App& app) {
  struct Arguments {
    std::string weights, out;
  };
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "shrink",
      "Weights that 'stipple train' has learned, with 16 bits for each number: half the size");
  command->add_option("weights", arguments->weights, "weights.safetensors or flow.safetensors")
      ->required();
  command->add_option("out", arguments->out, "The same, smaller")->required();
  command->callback([arguments] {
    check(stipple_weights_save_half_sized(arguments->weights.c_str(), arguments->out.c_str()));
  });
}

}  // namespace stipple::cli
