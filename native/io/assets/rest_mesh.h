#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace stipple {

/// The stored parts of the mesh at rest that an asset's splats follow (motion/surface_binding.h):
/// the tensors `bind.*` of an asset of any kind. Which triangles a splat follows is found when it
/// is decoded, for every budget anew.
struct RestMesh {
  std::vector<float> positions;     ///< [V,3] in the frame of the splats
  std::vector<uint32_t> triangles;  ///< [T,3]
  uint64_t topology = 0;            ///< tells its faces from others
  bool around = false;              ///< several triangles smoothly, not the nearest alone
};

/// That of an asset, none where it has none. Errors: kIo, kFormat, kUnsupported (newer major
/// version).
std::optional<RestMesh> readRestMesh(const std::string& path);

/// Writes an asset once more, with this mesh in the place of an earlier one; `out` may be the same
/// file. Everything else is carried over as it is. Errors: kInvalidArgument for a mesh without
/// faces, indices beyond its vertices, numbers that are not finite; those of readRestMesh();
/// kUnsupported for a checkpoint.
void writeRestMesh(const std::string& in, const RestMesh& rest, const std::string& out);

}  // namespace stipple
