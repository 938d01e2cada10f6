#pragma once

#include <cstdint>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "math/camera.h"
#include "train/backend/backend_factory.h"

namespace stipple {

enum class ViewRig : uint32_t {
  kAutomatic =
      0,        ///< around; both in turn, two of a kind, where the cloud surrounds its own middle
  kAround = 1,  ///< from a sphere around the cloud, looking at its middle
  kInside = 2,  ///< from places near the middle, looking out: rooms, landscapes
};

struct ViewRigOptions {
  ViewRig rig = ViewRig::kAutomatic;
  uint32_t count = 10;  ///< views, 1..4096
  uint32_t size = 400;  ///< pixels per side, 1..65536
  uint64_t seed = 0;    ///< other seeds give other views, spread as evenly
};

/// Cameras that see a cloud from everywhere: directions of a turned Fibonacci sphere.
/// Errors: kInvalidArgument for an empty cloud, a count or size out of range.
std::vector<Camera> viewsOfCloud(const BackendFactory& backends, const SplatCloud& cloud,
                                 const ViewRigOptions& options);

/// Views that tell which splats are seen, as many pixels as viewsOfCloud has, or up to twice as
/// many. Views from around are as there. Instead of others from inside, all directions are looked
/// at from each of a few places, through the faces of a cube: what no view from inside shows would
/// count as hidden by the walls. Of a hollow cloud, two fifths of `count` are views from around and
/// as many places. Errors: those of viewsOfCloud.
std::vector<Camera> viewsForVisibility(const BackendFactory& backends, const SplatCloud& cloud,
                                       const ViewRigOptions& options);

/// How a cloud looks from its middle: kInside, a room or a hollow thing, where at least half of the
/// directions from the middle of the cloud end on a surface farther than 0.3 of its radius.
ViewRig chooseRig(const BackendFactory& backends, const SplatCloud& cloud);

}  // namespace stipple
