#include "cli/lens_options.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

namespace stipple::cli {

namespace {

constexpr double kPi = std::numbers::pi;

/// All that the model sees fills the picture: the sphere, or the circle of a fisheye.
void takeModel(const LensArguments& arguments, StippleCamera& camera) {
  if (arguments.model.empty()) return;
  const double width = camera.width, height = camera.height;
  const double view = arguments.field_of_view * kPi / 180;
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  camera.field_of_view = 0;
  if (arguments.model == "equirectangular") {
    camera.model = STIPPLE_CAMERA_EQUIRECTANGULAR;
    camera.fx = width / (2 * kPi);
    camera.fy = height / kPi;
    return;
  }
  const bool is_equidistant = arguments.model == "fisheye-equidistant";
  camera.model =
      is_equidistant ? STIPPLE_CAMERA_FISHEYE_EQUIDISTANT : STIPPLE_CAMERA_FISHEYE_EQUISOLID;
  camera.field_of_view = view;
  camera.fx = camera.fy =
      std::min(width, height) / (is_equidistant ? view : 4 * std::sin(0.25 * view));
}

}  // namespace

void addLensOptions(CLI::App& command, LensArguments& arguments) {
  command
      .add_option("--camera-model", arguments.model,
                  "In place of the camera's own; with --projection ray or --accuracy rays")
      ->check(CLI::IsMember({"equirectangular", "fisheye-equidistant", "fisheye-equisolid"}));
  command
      .add_option("--field-of-view", arguments.field_of_view, "Of a fisheye, degrees, up to 360")
      ->capture_default_str();
  command.add_option("--aperture", arguments.aperture_radius,
                     "Radius of the aperture, metres; default: everything is sharp");
  command.add_option("--focus-distance", arguments.focus_distance,
                     "Metres; needed with --aperture");
  command.add_option("--blades", arguments.blades,
                     "Corners of the aperture, 3 to 64; default: round");
  command.add_option("--aperture-rotation", arguments.rotation, "Degrees");
  command.add_option("--aperture-ratio", arguments.ratio, "Height of the aperture over its width")
      ->capture_default_str();
  command.add_option("--moves-to", arguments.moves_to,
                     "The view where the camera is when the shutter closes: motion blur");
  command.add_option("--changes-to", arguments.changes_to,
                     "The splats of each file when the shutter closes, as many and in the same "
                     "order: one file for each of in");
  command.add_option(
      "--blur-samples", arguments.samples,
      "Number of images that are averaged over aperture, time and pixel, 1 to 65536; default: by "
      "how far they spread the splats");
}

LensSettings::LensSettings(const Context& context, const CameraArguments& camera_arguments,
                           const LensArguments& arguments, uint64_t cloud_count,
                           StippleCamera& camera)
    : aperture_(sized<StippleAperture>()),
      shutter_(sized<StippleShutter>()),
      last_(context, arguments.changes_to),
      samples_(arguments.samples.value_or(0)) {
  takeModel(arguments, camera);
  if (arguments.samples && samples_ == 0) {
    throw Failure("--blur-samples is 0; 1 to 65536 is allowed");
  }
  if (arguments.aperture_radius != 0 && arguments.focus_distance == 0) {
    throw Failure("--aperture needs --focus-distance, in metres");
  }
  aperture_.aperture_radius = arguments.aperture_radius;
  aperture_.focus_distance = arguments.focus_distance;
  aperture_.blades = arguments.blades;
  aperture_.rotation = arguments.rotation * kPi / 180;
  aperture_.ratio = arguments.ratio;
  if (!arguments.changes_to.empty()) {
    if (last_.count() != cloud_count) {
      throw Failure("--changes-to names " + std::to_string(last_.count()) + " files; " +
                    std::to_string(cloud_count) + " are rendered, and each needs one");
    }
    clouds_.assign(cloud_count, nullptr);
    for (uint64_t i = 0; i < cloud_count; ++i) clouds_.push_back(last_.instances()[i].cloud);
    shutter_.clouds = clouds_.data();
    shutter_.step_count = 2;
  }
  if (!arguments.moves_to) return;
  CameraArguments last = camera_arguments;
  last.view = *arguments.moves_to;
  const StippleCamera end = cameraOf(context, last);
  cameras_.assign(camera.world_to_camera, camera.world_to_camera + 16);
  cameras_.insert(cameras_.end(), end.world_to_camera, end.world_to_camera + 16);
  shutter_.cameras = cameras_.data();
  shutter_.step_count = 2;
}

void LensSettings::putInto(StippleRenderOptions& options) const {
  if (aperture_.aperture_radius != 0) options.aperture = &aperture_;
  if (shutter_.step_count > 0) options.shutter = &shutter_;
  options.samples = samples_;
}

}  // namespace stipple::cli
