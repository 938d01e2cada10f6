#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace stipple {

/// What another renderer drew of everything but the splats, to stand between them as a surface, and
/// the picture of both. Colours are premultiplied and scene linear. All arrays share one order of
/// rows, whichever that is.
///
/// Order of calls: holdOut, takeWorld, takeShadow, lightBefore as far as each is needed; then what
/// is read.
class MeshLayers {
 public:
  /// Its passes, of a film that was transparent. In: combined [H,W,4]; depth [H,W], of one sample
  /// of each pixel, kEmptyDepth or NaN where nothing is; shadow [H,W,3], factors of the light of
  /// what is behind a shadow catcher, or empty without one. Values that are not finite count as
  /// nothing: they show as black in every picture and must not stop this one. Errors:
  /// kInvalidArgument for sides of 0 and arrays of another size.
  MeshLayers(uint32_t width, uint32_t height, std::span<const float> combined,
             std::span<const float> depth, std::span<const float> shadow);

  /// Takes the holdouts, of which the passes show nothing but what they leave of the rest.
  /// In: depth [H,W] of the nearest; opacity [H,W], the share of each pixel that they hide.
  void holdOut(std::span<const float> depth, std::span<const float> opacity);

  /// Takes the light that the camera sees of the world. In: seen [H,W,3], the pass of it; plain,
  /// its colour where it has a single one. Behind a shadow catcher, where the pass has nothing,
  /// stands that colour, or what pixels around show.
  void takeWorld(std::span<const float> seen, const std::optional<std::vector<float>>& plain);

  /// Takes the light of shadow catchers from another picture than the passes, which have nothing of
  /// them. In: shadow [H,W,3], factors of the light of what is behind a catcher, 1 elsewhere.
  /// Errors: kInvalidArgument where the passes came with a shadow.
  void takeShadow(std::span<const float> shadow);

  /// Leaves shadows to the splats at and behind shadow catchers. In: composited colours [H,W,4] of
  /// the splats before the catchers, and of all; the light of each pixel is shared as these are.
  void lightBefore(std::span<const float> before, std::span<const float> whole);

  uint32_t width() const { return width_; }
  uint32_t height() const { return height_; }
  /// Whether splats are lit less anywhere.
  bool hasShadows() const;

  /// [H,W] how far the meshes are, holdouts included. A depth is that of one sample, which may have
  /// missed the mesh that the colour is of: pixels that a mesh covers in part take the nearest
  /// depth among themselves and their eight neighbours that a mesh covers.
  std::vector<float> surfaceDepth() const;
  const std::vector<float>& colour() const { return colour_; }  ///< [H,W,4] of meshes alone
  const std::vector<float>& light() const { return light_; }    ///< [H,W,3], or empty: 1
  /// [H,W] how much meshes and holdouts hide. The alpha is that of what holdouts leave of meshes.
  std::vector<float> hidden() const;
  bool hasHoldouts() const { return !held_opacity_.empty(); }

  /// The meshes as a matte with shadow catchers, each `margin` metres nearer than it is. Nothing
  /// behind a catcher is left, nor, where a mesh before it covers a pixel in part, what is between
  /// the two. In: catcher_depth [H,W]. Out: depth, opacity [H,W].
  void matteOf(std::span<const float> catcher_depth, float margin, std::span<float> depth,
               std::span<float> opacity) const;

  /// The picture of meshes, splats and world. In and out: colour [H,W,4] and depth [H,W] of splats
  /// drawn with the surface between them; transmittance [H,W] of that picture.
  void compose(std::span<float> colour, std::span<float> depth,
               std::span<const float> transmittance) const;

  /// Bytes that a picture of this size holds at most.
  static uint64_t memoryBound(uint32_t width, uint32_t height);

 private:
  size_t pixelCount() const { return size_t{width_} * height_; }
  float hiddenAt(size_t pixel) const;

  uint32_t width_ = 0;
  uint32_t height_ = 0;
  std::vector<float> depth_;         ///< [H,W]
  std::vector<float> colour_;        ///< [H,W,4] alpha of meshes alone
  std::vector<float> held_depth_;    ///< [H,W] of holdouts, or empty
  std::vector<float> held_opacity_;  ///< [H,W]
  std::vector<float> world_;         ///< [H,W,3] or empty: the film stays transparent
  std::vector<float> light_;         ///< [H,W,3] factors of the splats, or empty
  std::vector<float> passed_;        ///< [H,W] what is left of the light behind, or empty: 1
};

}  // namespace stipple
