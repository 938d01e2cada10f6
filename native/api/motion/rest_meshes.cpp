#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "api/conversions.h"
#include "api/guard.h"
#include "api/handles.h"
#include "io/assets/rest_mesh.h"
#include "motion/surface_binding.h"

using namespace stipple;
using namespace stipple::api;

namespace {

RestMesh restFrom(const float* positions, uint64_t vertex_count, const uint32_t* triangles,
                  uint64_t triangle_count, uint32_t reach) {
  const size_t numbers = requireTriples(vertex_count, "vertex_count");
  const size_t corners = requireTriples(triangle_count, "triangle_count");
  if (numbers > 0) require(positions, "positions");
  if (corners > 0) require(triangles, "triangles");
  RestMesh rest;
  rest.positions.assign(positions, positions + numbers);
  rest.triangles.assign(triangles, triangles + corners);
  rest.topology = topologyOf(vertex_count, rest.triangles);
  rest.around =
      enumValue<BindingReach>(reach, STIPPLE_BIND_AROUND, "reach") == BindingReach::kAround;
  return rest;
}

/// That of a file, whose faces are those that it was written with.
std::optional<RestMesh> requireRest(const char* path_utf8) {
  const std::string path = &require(path_utf8, "path_utf8");
  std::optional<RestMesh> rest = readRestMesh(path);
  if (rest && rest->topology != topologyOf(rest->positions.size() / 3, rest->triangles)) {
    fail(ErrorCode::kFormat, path +
                                 ": the faces of its mesh at rest are not those that its "
                                 "topology was made of; the file is damaged");
  }
  return rest;
}

}  // namespace

extern "C" {

StippleStatus stipple_asset_bind(StippleContext* context, const char* path_utf8,
                                 const float* positions, uint64_t vertex_count,
                                 const uint32_t* triangles, uint64_t triangle_count, uint32_t reach,
                                 const char* out_utf8) {
  return guarded([&] {
    require(context, "context");
    const std::string in = &require(path_utf8, "path_utf8");
    const std::string out = &require(out_utf8, "out_utf8");
    writeRestMesh(in, restFrom(positions, vertex_count, triangles, triangle_count, reach), out);
  });
}

StippleStatus stipple_asset_rest_info(StippleContext* context, const char* path_utf8,
                                      StippleRestInfo* info) {
  return guarded([&] {
    require(context, "context");
    const std::optional<RestMesh> rest = requireRest(path_utf8);
    StippleRestInfo out = {};
    if (rest) {
      out.reach = rest->around ? STIPPLE_BIND_AROUND : STIPPLE_BIND_SURFACE;
      out.vertex_count = rest->positions.size() / 3;
      out.triangle_count = rest->triangles.size() / 3;
      out.topology = rest->topology;
    }
    deliver(info, out, "info");
  });
}

StippleStatus stipple_asset_read_rest(StippleContext* context, const char* path_utf8,
                                      uint64_t vertex_capacity, float* positions,
                                      uint64_t triangle_capacity, uint32_t* triangles) {
  return guarded([&] {
    require(context, "context");
    const std::optional<RestMesh> rest = requireRest(path_utf8);
    if (!rest) return;
    requireCapacity(rest->positions.size() / 3, vertex_capacity, "vertices");
    requireCapacity(rest->triangles.size() / 3, triangle_capacity, "triangles");
    if (positions) std::copy(rest->positions.begin(), rest->positions.end(), positions);
    if (triangles) std::copy(rest->triangles.begin(), rest->triangles.end(), triangles);
  });
}

}  // extern "C"
