#pragma once

#include <cstdint>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "data/meshes/tri_mesh.h"
#include "train/backend/backend_factory.h"
#include "train/loop/view_rig.h"

namespace stipple {

struct RefineOptions {
  uint32_t iterations = 100;  ///< steps, one view each; raising it fits better and takes longer
  uint32_t view_count = 32;   ///< pictures of the full cloud, 1..4096
  uint32_t view_size = 800;   ///< pixels per side; larger ones fit what is seen from nearer by
  ViewRig rig = ViewRig::kAutomatic;
  uint64_t seed = 0;
  double ssim_share = 0.0;  ///< 0..1 of the loss beside L1
  /// The whole work ends by then, with as many steps as fit, whose rates fall as time goes by; 0:
  /// it takes all steps.
  double seconds = 0;
};

/// Fits a reduced cloud to pictures of the full one: every attribute by Adam, the count stays.
/// Colour and coverage both count: pictures are composited over black and over white in turn.
/// In: start: the splats to move, as a cut gives them; full: what they stand for.
/// Returns: as many splats as start, in its order.
/// Errors: kInvalidArgument for an empty cloud, clouds of different colour space, options out of
/// range. Same result for any number of threads, but where seconds decide how many steps there are.
/// Cost: iterations times (drawing, loss, backward) of one view, and view_count drawings of full.
/// Source: Kerbl, Kopanas, Leimkuehler, Drettakis, 3D Gaussian Splatting, SIGGRAPH 2023, section 5
/// (loss and Adam on activated attributes). Differs: no densification; targets are drawings.
SplatCloud refineCloud(const BackendFactory& backends, const SplatCloud& start,
                       const SplatCloud& full, const RefineOptions& options,
                       Progress* progress = nullptr);

/// The same with pictures of the mesh that the splats were made from, in its own colours, without
/// light. An automatic rig looks from around, and from inside as well where the faces look at the
/// middle of the mesh, as in a room. Errors: as refineCloud, and for a mesh that validate()
/// refuses.
SplatCloud refineToMesh(const BackendFactory& backends, const SplatCloud& start,
                        const TriMesh& mesh, const RefineOptions& options,
                        Progress* progress = nullptr);

uint64_t refineToMeshMemoryBound(const BackendFactory& backends, const SplatCloud& start,
                                 const TriMesh& mesh, const RefineOptions& options);

/// Upper bound of the bytes that refineCloud allocates: targets, and what a step holds. Errors: as
/// refineCloud.
uint64_t refineMemoryBound(const BackendFactory& backends, const SplatCloud& start,
                           const SplatCloud& full, const RefineOptions& options);

}  // namespace stipple
