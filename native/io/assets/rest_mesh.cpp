#include "io/assets/rest_mesh.h"

#include <algorithm>

#include "base/error.h"
#include "io/assets/asset_header.h"

namespace stipple {

namespace {

constexpr char kPositions[] = "bind.rest";
constexpr char kTriangles[] = "bind.triangles";
constexpr char kTopology[] = "bind.topology";
constexpr char kReach[] = "bind_reach";
constexpr char kAround[] = "around";
constexpr char kSurface[] = "surface";

/// For a mesh from either side.
void validateRest(const RestMesh& rest, const std::string& name, ErrorCode code) {
  const size_t count = rest.positions.size() / 3;
  if (rest.triangles.empty() || rest.triangles.size() % 3 != 0 || rest.positions.size() % 3 != 0) {
    fail(code, name + " has a mesh at rest of " + std::to_string(count) + " vertices and " +
                   std::to_string(rest.triangles.size() / 3) +
                   " triangles; at least one triangle is needed");
  }
  const uint32_t last = *std::max_element(rest.triangles.begin(), rest.triangles.end());
  if (last >= count) {
    fail(code, name + " has a mesh at rest whose triangles name vertex " + std::to_string(last) +
                   "; it has " + std::to_string(count) + ", counted from 0");
  }
  try {
    requireFinite(rest.positions.data(), rest.positions.size(), 3, "position of vertex");
  } catch (const Error& error) {
    fail(code, name + ": the mesh at rest: " + error.what());
  }
}

}  // namespace

std::optional<RestMesh> readRestMesh(const std::string& path) {
  const SafeTensorsReader file(path);
  assetKind(file);
  if (!file.tensors().contains(kPositions)) return std::nullopt;
  RestMesh rest;
  rest.positions = file.readFloats(kPositions, 3);
  rest.triangles = file.readUint32s(kTriangles, 3);
  const std::vector<uint64_t> topology = file.readUint64s(kTopology, 1);
  if (topology.size() != 1) {
    fail(ErrorCode::kFormat, path + ": " + kTopology + " has " + std::to_string(topology.size()) +
                                 " numbers; one is needed");
  }
  rest.topology = topology[0];
  rest.around = isFirstText(file, kReach, kAround, kSurface);
  validateRest(rest, path, ErrorCode::kFormat);
  return rest;
}

void writeRestMesh(const std::string& in, const RestMesh& rest, const std::string& out) {
  validateRest(rest, in, ErrorCode::kInvalidArgument);
  const SafeTensorsReader file(in);
  if (assetKind(file) == kAssetCheckpoint) {
    fail(ErrorCode::kUnsupported, in + " is the checkpoint of a fit; a model is needed");
  }
  const AssetExtras others = readAssetExtras(file);
  const std::vector<uint64_t> topology = {rest.topology};
  SafeTensorsWriter writer;
  writer.add(kPositions, rest.positions, 3);
  writer.add(kTriangles, rest.triangles, 3);
  writer.add(kTopology, topology, 1);
  writer.setMetadata(kReach, rest.around ? kAround : kSurface);
  addAssetExtras(writer, others);
  writer.write(out);
}

}  // namespace stipple
