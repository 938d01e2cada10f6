#pragma once

#include <cstdint>
#include <span>

#include "mesh/mesh_depth.h"

namespace stipple {

constexpr uint32_t kMaxMatteSide = 16;

/// Refuses a camera without an image plane or outside its range, a side that is not
/// 1..kMaxMatteSide, and one that makes the picture too large. Errors: kInvalidArgument.
void validateMatte(const Camera& camera, uint32_t side);

/// What meshes hide as a camera sees them, with smooth edges: each pixel is hidden as far as its
/// side x side samples are. Out: depth [H,W], that of the nearest sample, kEmptyDepth where none
/// hits; opacity [H,W], the share of samples that do. Errors: those of validateMatte and
/// drawMeshDepth; kInvalidArgument for arrays of another size. Same bits for any number of threads.
void drawMatte(std::span<const MeshInstance> instances, const Camera& camera, uint32_t side,
               std::span<float> depth, std::span<float> opacity, Progress* progress = nullptr);

/// Bytes that it allocates at most.
uint64_t matteMemoryBound(std::span<const MeshInstance> instances, const Camera& camera,
                          uint32_t side);

}  // namespace stipple
