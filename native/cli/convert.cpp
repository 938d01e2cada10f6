#include <memory>

#include "cli/commands.h"
#include "cli/formats.h"

namespace stipple::cli {

void addConvert(CLI::App& app, const Context& context) {
  struct Arguments {
    std::string in, out, frame;
    bool ascii = false;
    uint32_t degree = 4;
    uint32_t version = 0;
  };
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("convert", "Any splat format to any other");
  command->add_option("in", arguments->in, "Splat file to read")->required();
  command->add_option("out", arguments->out, "Splat file to write")->required();
  command->add_flag("--ascii", arguments->ascii, "Write a PLY as text");
  command
      ->add_option("--degree", arguments->degree, "Leave out harmonics above this degree, 0 to 4")
      ->capture_default_str();
  command
      ->add_option("--format-version", arguments->version,
                   "Version of the format to write (SPZ: 3 or 4); 0: the newest")
      ->capture_default_str();
  command->add_option(
      "--frame", arguments->frame,
      "Frame that positions are written in, such as RDF, RUB or RFU; without it the "
      "format's own");
  command->callback([arguments, &context] {
    if (!hasSplatEnding(arguments->out)) {
      throw Failure("'" + arguments->out + "' is not a splat file; " + splatEndings(true) +
                    " is expected");
    }
    StippleCloudSaveOptions options;
    stipple_cloud_save_options_init(&options);
    options.ascii = arguments->ascii ? 1 : 0;
    options.sh_degree_limit = arguments->degree;
    options.format_version = arguments->version;
    if (!arguments->frame.empty()) options.frame = frameOfName(arguments->frame);
    const auto cloud = make<Cloud>(stipple_cloud_load, context.get(), arguments->in.c_str());
    check(stipple_cloud_save(cloud.get(), arguments->out.c_str(), &options));
  });
}

}  // namespace stipple::cli
