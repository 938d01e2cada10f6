#pragma once

#include "data/meshes/polygon_surface.h"
#include "data/sparse_volume.h"

namespace stipple {

/// The surface at which a volume's density passes `threshold`, by OpenVDB's volumeToMesh.
/// In: threshold > 0, per metre; adaptivity 0..1: faces grow where the surface is flat.
/// Errors: kInvalidArgument for values outside their range, for a volume without voxels and, with
/// the largest density, for a threshold that no voxel reaches; kUnavailable (media library
/// missing). Threads: the caller's limit. It cannot be cancelled.
PolygonSurface surfaceOfVolume(const SparseVolume& volume, double threshold, double adaptivity);

/// Upper bound of the bytes that it, and making triangles of its result, allocate beside the
/// volume.
uint64_t surfaceMemoryBound(const SparseVolume& volume, double threshold);

}  // namespace stipple
