#include <stipple/stipple.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <string>

#include "api/camera.h"
#include "api/guard.h"
#include "fit/scene_rig.h"

using namespace stipple;
using namespace stipple::api;

struct StippleRigSearch {
  SceneRig rig;
};

namespace {

static_assert(sizeof(SceneRay) == 7 * sizeof(double), "rays are handed over as they lie");

SceneRigOptions optionsFrom(const StippleRigSearchOptions& given) {
  SceneRigOptions options;
  options.rig = enumValue<ViewRig>(given.view_rig, 2, "options->view_rig");
  options.count = given.view_count;
  options.size = given.view_size;
  options.seed = given.seed;
  options.angle = given.angle;
  options.lowest = Vec3d(given.bounds_min[0], given.bounds_min[1], given.bounds_min[2]);
  options.highest = Vec3d(given.bounds_max[0], given.bounds_max[1], given.bounds_max[2]);
  if (given.has_viewer) {
    options.viewer = Vec3d(given.viewer[0], given.viewer[1], given.viewer[2]);
  }
  return options;
}

SceneHits hitsFrom(const StippleRayHits& given) {
  const size_t count = given.count;
  SceneHits hits;
  if (count > 0) {
    hits.distances = {&require(given.distances, "hits->distances"), count};
    hits.normals = {&require(given.normals, "hits->normals"), 3 * count};
    hits.objects = {&require(given.objects, "hits->objects"), count};
  }
  if (given.object_count > 0) {
    const double& sizes = require(given.object_sizes, "hits->object_sizes");
    hits.object_sizes = {&sizes, 3 * size_t{given.object_count}};
  }
  return hits;
}

}  // namespace

extern "C" {

void stipple_rig_search_options_init(StippleRigSearchOptions* options) {
  if (!options) return;
  const SceneRigOptions defaults;
  *options = {};
  options->struct_size = sizeof(StippleRigSearchOptions);
  options->view_rig = static_cast<uint32_t>(defaults.rig);
  options->view_count = defaults.count;
  options->view_size = defaults.size;
}

StippleStatus stipple_rig_search_create(const StippleRigSearchOptions* options,
                                        StippleRigSearch** search) {
  return guarded([&] {
    require(search, "search");
    StippleRigSearchOptions defaults;
    stipple_rig_search_options_init(&defaults);
    *search = new StippleRigSearch{SceneRig(optionsFrom(completed(options, defaults, "options")))};
  });
}

void stipple_rig_search_free(StippleRigSearch* search) {
  delete search;
}

StippleStatus stipple_rig_search_rays(const StippleRigSearch* search, uint64_t capacity,
                                      double* rays, uint64_t* count) {
  return guarded([&] {
    const std::vector<SceneRay>& asked = require(search, "search").rig.rays();
    require(count, "count") = asked.size();
    if (!rays || asked.empty()) return;
    requireCapacity(asked.size(), capacity, "rays");
    std::memcpy(rays, asked.data(), asked.size() * sizeof(SceneRay));
  });
}

StippleStatus stipple_rig_search_answer(StippleRigSearch* search, const StippleRayHits* hits) {
  return guarded([&] { require(search, "search").rig.answer(hitsFrom(complete(hits, "hits"))); });
}

StippleStatus stipple_rig_search_camera(const StippleRigSearch* search, uint64_t index,
                                        StippleCamera* camera) {
  return guarded([&] {
    const SceneRig& rig = require(search, "search").rig;
    if (!rig.rays().empty()) {
      fail(ErrorCode::kInvalidArgument, "the search still asks " +
                                            std::to_string(rig.rays().size()) +
                                            " rays; answer them first");
    }
    if (index >= rig.cameras().size()) {
      fail(ErrorCode::kInvalidArgument,
           "camera " + std::to_string(index) + " was asked for; there are " +
               std::to_string(rig.cameras().size()) + ", counted from 0");
    }
    deliver(camera, cameraTo(rig.cameras()[index]), "camera");
  });
}

}  // extern "C"
