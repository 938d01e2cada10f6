#include <algorithm>
#include <chrono>
#include <memory>
#include <vector>

#include "cli/accuracy_options.h"
#include "cli/camera_options.h"
#include "cli/commands.h"
#include "cli/lens_options.h"
#include "cli/placed_clouds.h"
#include "cli/report.h"

namespace stipple::cli {

namespace {

struct Arguments {
  std::vector<std::string> in;
  std::string out, colour, low_pass, blend = "as-trained", objects = "together";
  std::string depth, normal, index;
  LensArguments lens;
  AccuracyArguments accuracy;
  CameraArguments camera;
  std::vector<double> background;
  double time = 0;
};

StippleRenderOptions optionsOf(const Arguments& arguments, const StippleAccuracy& accuracy) {
  StippleRenderOptions options;
  stipple_render_options_init(&options);
  options.accuracy = &accuracy;
  if (arguments.low_pass == "classic") options.low_pass = STIPPLE_LOW_PASS_CLASSIC;
  if (arguments.low_pass == "mip") options.low_pass = STIPPLE_LOW_PASS_MIP;
  if (arguments.low_pass == "none") options.low_pass = STIPPLE_LOW_PASS_NONE;
  if (arguments.blend == "scene-linear") options.blend_space = STIPPLE_BLEND_SCENE_LINEAR;
  if (arguments.objects == "apart") options.object_order = STIPPLE_OBJECTS_APART;
  if (arguments.colour == "display") options.output_colour = STIPPLE_OUTPUT_COMPOSITED;
  if (!arguments.background.empty()) {
    options.with_background = 1;
    std::copy(arguments.background.begin(), arguments.background.end(), options.background);
  }
  return options;
}

/// One more buffer of the picture, and the file that it goes to.
class Pass {
 public:
  Pass(const std::string& path, const StippleCamera& camera, uint32_t channels)
      : path_(path), width_(camera.width), height_(camera.height), channels_(channels) {
    if (path.empty()) return;
    if (!path.ends_with(".exr")) {
      throw Failure("'" + path + "' cannot hold distances or numbers; .exr is expected");
    }
    pixels_.resize(size_t{width_} * height_ * channels);
  }

  float* pixels() { return path_.empty() ? nullptr : pixels_.data(); }

  void save(const Context& context) const {
    if (path_.empty()) return;
    const auto image = make<Image>(stipple_image_create, context.get(), width_, height_, channels_,
                                   static_cast<uint32_t>(STIPPLE_TRANSFER_LINEAR), pixels_.data());
    check(stipple_image_save(image.get(), path_.c_str(), 1u));
  }

 private:
  std::string path_;
  uint32_t width_, height_, channels_;
  std::vector<float> pixels_;
};

void render(const Context& context, const Arguments& arguments) {
  if (fileKind(arguments.out) != FileKind::kImage) {
    throw Failure("'" + arguments.out + "' is not an image; .png or .exr is expected");
  }
  StippleCamera camera = cameraOf(context, arguments.camera);
  const LensSettings lens(context, arguments.camera, arguments.lens, arguments.in.size(), camera);
  const StippleAccuracy accuracy = accuracyOf(arguments.accuracy);
  StippleRenderOptions options = optionsOf(arguments, accuracy);
  lens.putInto(options);
  const PlacedClouds clouds(context, arguments.in, arguments.time);
  Pass depth(arguments.depth, camera, 1), normal(arguments.normal, camera, 3);
  Pass index(arguments.index, camera, 1);
  std::vector<float> colour(size_t{camera.width} * camera.height * 4);
  auto buffers = sized<StippleRenderBuffers>();
  buffers.colour = colour.data();
  buffers.depth = depth.pixels();
  buffers.normal = normal.pixels();
  std::vector<uint32_t> objects(index.pixels() ? size_t{camera.width} * camera.height : 0);
  if (index.pixels()) buffers.object_index = objects.data();
  const auto renderer = make<Renderer>(stipple_renderer_create, context.get());
  const auto start = std::chrono::steady_clock::now();
  const auto job = make<Job>(stipple_renderer_render_start, renderer.get(), clouds.instances(),
                             clouds.count(), const_cast<const StippleCamera*>(&camera),
                             const_cast<const StippleRenderOptions*>(&options),
                             const_cast<const StippleRenderBuffers*>(&buffers));
  finish(job);
  const double seconds = secondsSince(start);
  const auto image = make<Image>(stipple_image_create, context.get(), camera.width, camera.height,
                                 4u, static_cast<uint32_t>(STIPPLE_TRANSFER_LINEAR),
                                 const_cast<const float*>(colour.data()));
  // A named colour keeps the values as they are; else the format decides (PNG display, EXR linear).
  check(stipple_image_save(image.get(), arguments.out.c_str(), arguments.colour.empty() ? 0u : 1u));
  std::transform(objects.begin(), objects.end(), index.pixels(),
                 [](uint32_t object) { return static_cast<float>(object); });
  for (const Pass* pass : {&depth, &normal, &index}) pass->save(context);
  Report report;
  report.add("width", uint64_t{camera.width});
  report.add("height", uint64_t{camera.height});
  report.add("render_seconds", seconds);
  report.print(false);
}

}  // namespace

void addRender(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("render", "Draws an image of splats");
  command
      ->add_option("in", arguments->in,
                   "Splat files and models (.stipple.safetensors), rendered together; models at "
                   "the budget that shows them well")
      ->required();
  command->add_option("--time", arguments->time, "Seconds, of splats that move")
      ->capture_default_str();
  addCameraOptions(*command, arguments->camera);
  addLensOptions(*command, arguments->lens);
  addAccuracyOptions(*command, arguments->accuracy);
  command
      ->add_option("--colour", arguments->colour,
                   "Write composited (display) or scene linear values as they are, whatever the "
                   "format")
      ->check(CLI::IsMember({"display", "linear"}));
  command->add_option("--low-pass,--lowpass", arguments->low_pass, "Default: as the file says")
      ->check(CLI::IsMember({"classic", "mip", "none"}));
  command->add_option("--blend", arguments->blend, "as-trained, or scene-linear")
      ->check(CLI::IsMember({"as-trained", "scene-linear"}))
      ->capture_default_str();
  command
      ->add_option("--objects", arguments->objects,
                   "together: splats of all files by depth; apart: each file as a whole, by the "
                   "mean depth of its splats")
      ->check(CLI::IsMember({"together", "apart"}))
      ->capture_default_str();
  command
      ->add_option("--background", arguments->background,
                   "R G B, in the space of the output; default: transparent")
      ->expected(3);
  command->add_option("--depth", arguments->depth, "Also the depths, metres, into this .exr");
  command->add_option("--normal", arguments->normal,
                      "Also the normals, in the world, into this .exr");
  command->add_option("--object-index,--index", arguments->index,
                      "Also which file shows, from 1 on, 0 where none does, into this .exr");
  command->add_option("-o,--out", arguments->out, ".png or .exr")->required();
  command->callback([arguments, &context] { render(context, *arguments); });
}

}  // namespace stipple::cli
