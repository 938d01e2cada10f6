#pragma once

#include <cstdint>
#include <vector>

#include "base/progress.h"
#include "data/meshes/tri_mesh.h"
#include "fit/registration/pre_alignment.h"
#include "fit/registration/registration_loss.h"
#include "fit/registration/registration_target.h"
#include "fit/registration/registration_watch.h"
#include "mesh/adapt/mesh_adapter.h"
#include "mesh/adapt/surface_difference.h"

namespace stipple {

/// What a template is drawn as, to be compared with images.
enum class PictureDrawing : uint32_t {
  kTriangles = 0,  ///< MeshRenderer, whose outlines are sharp
  kSplats = 1,     ///< splats bound to the triangles, by the renderer of splats
};

struct RegistrationOptions {
  MeshAdapterOptions adapter;  ///< density, smoothness and steps
  RegistrationWeights weights;
  PreAlignment alignment = PreAlignment::kNone;
  /// After the steps, vertices go to the nearest place of the target's triangles, those of borders
  /// to its borders. A template that is its own target slides on itself, by slideEvenly(): of the
  /// other options density, steps, shortest, sharp_angle and those of the report have a part, and
  /// landmarks are refused.
  bool lands_on_target = false;
  /// 0..pi radians, of templates that slide: what differs by more stays sharp.
  double sharp_angle = 0.7853981633974483;
  uint64_t target_count = 20000;   ///< points of the target at most, 1 to 2^24: detail, and time
  uint32_t samples_per_point = 4;  ///< of the template for each of them, 1 to 64
  uint64_t report_count = 100000;  ///< samples of each side that the report is measured by; 0: no
                                   ///< report; 2^24 at most
  uint64_t seed = 0;               ///< of all samples
  uint32_t picture_side = 256;     ///< of targets that are images: pixels of the longer side that
                                   ///< are looked at, 16 to 4096
  PictureDrawing picture_drawing = PictureDrawing::kTriangles;  ///< of the same targets
  std::vector<Landmark> landmarks;  ///< vertices of the template as it is given
};

/// Errors: kInvalidArgument with the option, its value and what is allowed.
void validate(const RegistrationOptions& options);

struct RegistrationReport {
  bool is_measured = false;         ///< the two below are known
  SurfaceDifference before, after;  ///< between target and template, as given and as it became
  uint64_t place_count = 0;         ///< vertices that moved by themselves: each place once
  uint64_t loose_count = 0;  ///< vertices without a triangle, which went with the alignment alone
  bool turned_normals = false;  ///< the target looked inwards where the template looks outwards, or
                                ///< the other way round: its normals were taken the other way round
  uint32_t step_count = 0;      ///< steps that were taken: fewer where a watch has ended them
  double loss = 0;              ///< of the last step, without density, in the unit ball
  double picture_before = 0;    ///< of targets that are images: mean difference of their numbers
  double picture_after = 0;     ///< from those of the template, as given and as it became
};

struct RegisteredMesh {
  TriMesh mesh;  ///< the template with other positions, and normals where it had some
  RegistrationReport report;
};

/// Gives a template the shape of a target by moving its vertices; its triangles, UVs, colours and
/// materials stay bit for bit. Vertices in one place, as seams have them, move as one. Corners that
/// had one normal in one place have one again, the mean of their triangles' by angle. Rules: edges
/// with more than two triangles are edges like others, whose ends have no complexity; islands move
/// on their own, and share the mean edge length; triangles without area have no part. In: a mesh
/// that validate() accepts, of four triangles with area at least. Options: adapter.density,
/// adapter.steps; target_count, which detail cannot be finer than. Errors: kInvalidArgument for a
/// template of fewer triangles, a target without points, extent or weight, landmarks of vertices
/// that are missing or loose, a target without triangles that is to be landed on; kCancelled. In:
/// watch, or null: shows the shape after steps, and may end them. Threads and determinism:
/// parallel; same result for any number of threads. Cost: steps times a k-d tree of all samples and
/// five solves; registrationMemoryBound() bytes. Source: Jung, Kim et al., Mesh Density Adaptation
/// for Template-based Shape Reconstruction, SIGGRAPH 2023; docs/methods/mesh_adaptation.md.
RegisteredMesh registerMesh(const TriMesh& given, const RegistrationTarget& target,
                            const RegistrationOptions& options, Progress* progress = nullptr,
                            RegistrationWatch* watch = nullptr);

/// Bytes at most of registerMesh() with a target of that, and of making the target.
uint64_t registrationMemoryBound(const TriMesh& given, const TargetSource& source,
                                 const RegistrationOptions& options);

}  // namespace stipple
