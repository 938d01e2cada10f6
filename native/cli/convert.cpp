#include <memory>

#include "cli/commands.h"

namespace stipple::cli {

void addConvert(CLI::App& app, const Context& context) {
  struct Arguments {
    std::string in, out;
    bool ascii = false;
  };
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("convert", "Any splat format to any other");
  command->add_option("in", arguments->in, "Splat file to read")->required();
  command->add_option("out", arguments->out, "Splat file to write")->required();
  command->add_flag("--ascii", arguments->ascii, "Write a PLY as text");
  command->callback([arguments, &context] {
    if (fileKind(arguments->out) != FileKind::kSplats) {
      throw Failure("'" + arguments->out + "' is not a splat file; .ply is expected");
    }
    const auto cloud = make<Cloud>(stipple_cloud_load, context.get(), arguments->in.c_str());
    StippleCloudSaveOptions options;
    stipple_cloud_save_options_init(&options);
    options.ascii = arguments->ascii ? 1 : 0;
    check(stipple_cloud_save(cloud.get(), arguments->out.c_str(), &options));
  });
}

}  // namespace stipple::cli
