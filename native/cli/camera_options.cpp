#include "cli/camera_options.h"

#include <algorithm>

namespace stipple::cli {

namespace {

constexpr uint32_t kDefaultSide = 800;

}  // namespace

void addCameraOptions(CLI::App& command, CameraArguments& arguments) {
  command.add_option("--camera", arguments.path, "transforms.json, or a COLMAP folder")->required();
  command.add_option("--view", arguments.view, "Which camera of the file")->capture_default_str();
  command.add_option("--width", arguments.width, "Pixels; default: as the camera says");
  command.add_option("--height", arguments.height, "Pixels");
}

StippleCamera cameraOf(const Context& context, const CameraArguments& arguments) {
  const auto views = make<Views>(stipple_views_load, context.get(), arguments.path.c_str());
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

}  // namespace stipple::cli
