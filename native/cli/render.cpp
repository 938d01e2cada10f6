#include <chrono>
#include <memory>
#include <vector>

#include "cli/commands.h"
#include "cli/report.h"

namespace stipple::cli {

namespace {

struct Arguments {
  std::vector<std::string> in;
  std::string camera, out, accuracy = "final", colour, low_pass, blend = "as-trained";
  uint64_t view = 0;
  uint32_t width = 0, height = 0;
  std::vector<double> background;
};

constexpr uint32_t kDefaultSide = 800;

/// The view at the asked size; one missing side follows from the other.
StippleCamera cameraOf(const Context& context, const Arguments& arguments) {
  const auto views = make<Views>(stipple_views_load, context.get(), arguments.camera.c_str());
  auto camera = sized<StippleCamera>();
  check(stipple_views_camera(views.get(), arguments.view, &camera));
  uint32_t width = arguments.width, height = arguments.height;
  const bool sized_view = camera.width > 0 && camera.height > 0;
  const double aspect = sized_view ? static_cast<double>(camera.width) / camera.height : 1.0;
  if (width == 0 && height == 0) {
    width = sized_view ? camera.width : kDefaultSide;
    height = sized_view ? camera.height : kDefaultSide;
  } else if (width == 0) {
    width = std::max(1u, static_cast<uint32_t>(height * aspect + 0.5));
  } else if (height == 0) {
    height = std::max(1u, static_cast<uint32_t>(width / aspect + 0.5));
  }
  check(stipple_camera_resize(&camera, width, height));
  return camera;
}

StippleRenderOptions optionsOf(const Arguments& arguments) {
  StippleRenderOptions options;
  stipple_render_options_init(&options);
  if (arguments.accuracy == "double") options.method = STIPPLE_RENDER_REFERENCE;
  if (arguments.accuracy == "rays") options.method = STIPPLE_RENDER_RAYS;
  if (arguments.accuracy == "reference") options.method = STIPPLE_RENDER_YARDSTICK;
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
  const StippleCamera camera = cameraOf(context, arguments);
  const StippleRenderOptions options = optionsOf(arguments);
  std::vector<Cloud> clouds;
  std::vector<StippleInstance> instances;
  for (const std::string& path : arguments.in) {
    clouds.push_back(make<Cloud>(stipple_cloud_load, context.get(), path.c_str()));
    auto instance = sized<StippleInstance>();
    instance.cloud = clouds.back().get();
    for (int i = 0; i < 4; ++i) instance.matrix[i * 5] = 1.0;
    instances.push_back(instance);
  }
  std::vector<float> colour(size_t{camera.width} * camera.height * 4);
  auto buffers = sized<StippleRenderBuffers>();
  buffers.colour = colour.data();
  const auto renderer = make<Renderer>(stipple_renderer_create, context.get());
  const auto start = std::chrono::steady_clock::now();
  const auto job =
      make<Job>(stipple_renderer_render_start, renderer.get(),
                const_cast<const StippleInstance*>(instances.data()), uint64_t{instances.size()},
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
  command->add_option("--camera", arguments->camera, "transforms.json, or a COLMAP folder")
      ->required();
  command->add_option("--view", arguments->view, "Which camera of the file")->capture_default_str();
  command->add_option("--width", arguments->width, "Pixels; default: as the camera says");
  command->add_option("--height", arguments->height, "Pixels");
  command
      ->add_option(
          "--accuracy", arguments->accuracy,
          "final; double (the same in double precision); rays (exact projection and order); "
          "reference (rays without any limit, the yardstick)")
      ->check(CLI::IsMember({"final", "double", "rays", "reference"}))
      ->capture_default_str();
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
