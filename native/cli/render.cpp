#include <chrono>
#include <memory>
#include <vector>

#include "cli/accuracy_options.h"
#include "cli/camera_options.h"
#include "cli/commands.h"
#include "cli/placed_clouds.h"
#include "cli/report.h"

namespace stipple::cli {

namespace {

struct Arguments {
  std::vector<std::string> in;
  std::string out, colour, low_pass, blend = "as-trained";
  AccuracyArguments accuracy;
  CameraArguments camera;
  std::vector<double> background;
};

StippleRenderOptions optionsOf(const Arguments& arguments, const StippleAccuracy& accuracy) {
  StippleRenderOptions options;
  stipple_render_options_init(&options);
  options.accuracy = &accuracy;
  if (arguments.low_pass == "classic") options.low_pass = STIPPLE_LOW_PASS_CLASSIC;
  if (arguments.low_pass == "mip") options.low_pass = STIPPLE_LOW_PASS_MIP;
  if (arguments.low_pass == "none") options.low_pass = STIPPLE_LOW_PASS_NONE;
  if (arguments.blend == "scene-linear") options.blend_space = STIPPLE_BLEND_SCENE_LINEAR;
  if (arguments.colour == "display") options.output_colour = STIPPLE_OUTPUT_COMPOSITED;
  if (!arguments.background.empty()) {
    options.with_background = 1;
    std::copy(arguments.background.begin(), arguments.background.end(), options.background);
  }
  return options;
}

void render(const Context& context, const Arguments& arguments) {
  if (fileKind(arguments.out) != FileKind::kImage) {
    throw Failure("'" + arguments.out + "' is not a picture; .png or .exr is expected");
  }
  const StippleCamera camera = cameraOf(context, arguments.camera);
  const StippleAccuracy accuracy = accuracyOf(arguments.accuracy);
  const StippleRenderOptions options = optionsOf(arguments, accuracy);
  const PlacedClouds clouds(context, arguments.in);
  std::vector<float> colour(size_t{camera.width} * camera.height * 4);
  auto buffers = sized<StippleRenderBuffers>();
  buffers.colour = colour.data();
  const auto renderer = make<Renderer>(stipple_renderer_create, context.get());
  const auto start = std::chrono::steady_clock::now();
  const auto job =
      make<Job>(stipple_renderer_render_start, renderer.get(), clouds.instances(), clouds.count(),
                &camera, &options, const_cast<const StippleRenderBuffers*>(&buffers));
  finish(job);
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const auto image = make<Image>(stipple_image_create, context.get(), camera.width, camera.height,
                                 4u, static_cast<uint32_t>(STIPPLE_TRANSFER_LINEAR),
                                 const_cast<const float*>(colour.data()));
  // A named colour keeps the values as they are; else the format decides (PNG display, EXR linear).
  check(stipple_image_save(image.get(), arguments.out.c_str(), arguments.colour.empty() ? 0u : 1u));
  Report report;
  report.add("width", uint64_t{camera.width});
  report.add("height", uint64_t{camera.height});
  report.add("render_seconds", seconds);
  report.print(false);
}

}  // namespace

void addRender(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("render", "A picture of splats");
  command->add_option("in", arguments->in, "Splat files, rendered together")->required();
  addCameraOptions(*command, arguments->camera);
  addAccuracyOptions(*command, arguments->accuracy);
  command
      ->add_option("--colour", arguments->colour,
                   "Write composited (display) or scene linear values as they are, whatever the "
                   "format")
      ->check(CLI::IsMember({"display", "linear"}));
  command->add_option("--lowpass", arguments->low_pass, "Default: as the file says")
      ->check(CLI::IsMember({"classic", "mip", "none"}));
  command->add_option("--blend", arguments->blend, "as-trained, or scene-linear")
      ->check(CLI::IsMember({"as-trained", "scene-linear"}))
      ->capture_default_str();
  command
      ->add_option("--background", arguments->background,
                   "R G B, in the space of the output; default: transparent")
      ->expected(3);
  command->add_option("-o,--out", arguments->out, ".png or .exr")->required();
  command->callback([arguments, &context] { render(context, *arguments); });
}

}  // namespace stipple::cli
