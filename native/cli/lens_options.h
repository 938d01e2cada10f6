#pragma once

#include <CLI/CLI.hpp>

#include <optional>
#include <string>
#include <vector>

#include "cli/camera_options.h"
#include "cli/placed_clouds.h"

namespace stipple::cli {

/// What a camera is beyond a pinhole, and what its pictures are averages over.
struct LensArguments {
  std::string model;
  double field_of_view = 180;  ///< degrees
  double aperture_radius = 0, focus_distance = 0;
  uint32_t blades = 0;
  double rotation = 0;  ///< degrees
  double ratio = 1;
  std::optional<uint64_t> moves_to;  ///< a view
  std::vector<std::string> changes_to;  ///< splat files
  std::optional<uint32_t> samples;
};

void addLensOptions(CLI::App& command, LensArguments& arguments);

/// The options' lens and shutter, with what they point to; stays where it is made.
class LensSettings {
 public:
  LensSettings(const LensSettings&) = delete;
  LensSettings& operator=(const LensSettings&) = delete;

  /// Changes the camera to the model that is asked for. In: cloud_count, of files that are rendered.
  /// Errors: Failure.
  LensSettings(const Context& context, const CameraArguments& camera_arguments,
               const LensArguments& arguments, uint64_t cloud_count, StippleCamera& camera);

  /// Valid as long as this.
  void putInto(StippleRenderOptions& options) const;

 private:
  StippleAperture aperture_;
  StippleShutter shutter_;
  std::vector<double> cameras_;
  PlacedClouds last_;                        ///< when the shutter closes
  std::vector<const StippleCloud*> clouds_;  ///< [2, count] of both steps, or none
  uint32_t samples_;
};

}  // namespace stipple::cli
