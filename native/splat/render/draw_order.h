#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "base/progress.h"
#include "splat/render/render.h"

// What a graphics card needs to draw splats as blended quads: each splat's geometry, once per
// cloud, and for every view the order of all splats with their colours from there. The card
// projects by itself, so a view that turns is drawn at once with the order of an earlier one.

namespace stipple {

/// Rows are numbered in float32, exactly up to here.
constexpr uint64_t kMaxDrawRows = uint64_t{1} << 24;
/// Floats of a splat's geometry: x, y, z, opacity | w, x, y, z | scales, 0.
constexpr size_t kDrawGeometryFloats = 12;
/// Floats of a splat's row in the order of drawing.
constexpr size_t kDrawRowFloats = 4;
/// Colours of rows are held to 0..kMaxDrawColour.
constexpr float kMaxDrawColour = 64.0f;

/// What to make of an order; NULL: not wanted.
struct DrawOrderOutput {
  /// [N] splats back to front, counted through the instances. The reverse, bit for bit, of the
  /// order in which renderTiled blends them: depthKey of the centre's view z, ties by index.
  uint32_t* order = nullptr;
  /// [N,4] the same order: row of the splat's geometry, number of its instance, and its colour in
  /// two numbers: with c = round(65535 sqrt(colour / 64)) of each channel, held to 0..65535, they
  /// are 256 R + floor(G / 256) and 65536 (G mod 256) + B, both exact in float32. Colours are
  /// display values.
  float* rows = nullptr;
  /// [instances] row of the geometry of each instance's splat 0; instances may share rows.
  std::span<const uint64_t> first_rows;
  int sh_degree_limit = kMaxShDegree;
};

/// Memory that the next order uses again. One order at a time.
class DrawOrderWorkspace {
 public:
  DrawOrderWorkspace();
  ~DrawOrderWorkspace();
  DrawOrderWorkspace(DrawOrderWorkspace&&) noexcept;
  DrawOrderWorkspace& operator=(DrawOrderWorkspace&&) noexcept;

  uint64_t bytes() const;  ///< held now

  struct Arrays;
  Arrays& arrays() { return *arrays_; }

 private:
  std::unique_ptr<Arrays> arrays_;
};

/// Orders all splats of the instances, those behind the camera too: the order stays of use while
/// the view turns. Of the camera only the model and world_to_camera count. Matrices may be singular
/// (an object scaled to zero); its colours are then those of degree 0.
/// Same result for any number of threads. Errors: kInvalidArgument for a camera or cloud that
/// validate() refuses, a matrix that is not finite or not affine, a row above kMaxDrawRows.
/// Nothing is written where an error is thrown. Cost: O(N), 32 bytes per splat.
void orderForDrawing(std::span<const SplatInstance> instances, const Camera& camera,
                     const DrawOrderOutput& output, DrawOrderWorkspace& workspace,
                     Progress* progress = nullptr);

/// The checks of orderForDrawing that read no splats.
void validateDrawOrder(std::span<const SplatInstance> instances, const Camera& camera,
                       const DrawOrderOutput& output);

/// Bytes that orderForDrawing allocates at most for this many splats.
uint64_t drawOrderMemoryBound(uint64_t splat_count);

/// Writes the geometry of all splats of a cloud: [N, kDrawGeometryFloats].
void packDrawGeometry(const SplatCloud& cloud, float* geometry);

}  // namespace stipple
