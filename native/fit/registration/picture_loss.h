#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "fit/registration/bound_splats.h"
#include "fit/registration/target_pictures.h"
#include "mesh/adapt/harmonic_light.h"
#include "mesh/adapt/mesh_renderer.h"

namespace stipple {

class BackendFactory;

/// How unlike its images a mesh is: the mean difference of all channels of all pixels, colour and
/// coverage. Its colour is that of a white surface in light that depends on the normal alone
/// (HarmonicLight), which is found from the images again and again by least squares, so a colour
/// that all of the mesh has is a part of the light.
class PictureLoss {
 public:
  /// Keeps links, which must outlive it, and draws triangles.
  PictureLoss(std::vector<TargetPicture> pictures, const MeshLinks& links);

  /// Takes derivatives from splats from now on. In: who draws them; positions [n] of the mesh
  /// before it moves, metres, by which they are laid out.
  void drawSplats(const BackendFactory& backends, std::span<const Vec3d> positions);

  /// Adds the derivative by positions; outlines of triangles weigh `outline_weight` times, those of
  /// splats once. In: positions [n], metres. Out: gradient [n], per metre. Returns the loss.
  /// Errors: kCancelled. Threads and determinism: parallel; same result for any number of threads.
  /// Cost: two passes over all pixels.
  double addGradient(std::span<const Vec3d> positions, double outline_weight,
                     std::span<Vec3d> gradient);
  /// The loss alone, of triangles, in the light that suits it best.
  double at(std::span<const Vec3d> positions);

  const HarmonicLight& light() const { return light_; }
  std::span<const TargetPicture> pictures() const { return pictures_; }

 private:
  struct Splats;
  /// Light for what views_ show, whatever their colours are.
  void findLight(std::span<const Vec3d> normals);
  void drawAll(std::span<const Vec3d> positions, std::span<const Vec3d> colours);
  std::vector<Vec3d> coloursOf(std::span<const Vec3d> normals) const;
  /// The part of the loss of a picture, by views_. Out: by_pixel [H,W,4], in the view's box, or
  /// empty.
  double differenceOf(size_t picture, std::span<double> by_pixel) const;
  double addByTriangles(std::span<const Vec3d> colours, double outline_weight,
                        std::span<Vec3d> by_position, std::span<Vec3d> by_colour) const;
  double addBySplats(std::span<const Vec3d> positions, std::span<const Vec3d> colours,
                     std::span<Vec3d> by_position, std::span<Vec3d> by_colour);

  std::vector<TargetPicture> pictures_;
  const MeshLinks& links_;
  MeshRenderer renderer_;
  std::vector<MeshView> views_;     ///< what drawAll() drew last
  std::vector<double> shown_;       ///< of each picture, the sum of all its numbers
  std::shared_ptr<Splats> splats_;  ///< null: triangles are drawn; copies use its memory by turns
  HarmonicLight light_;
  uint32_t light_age_ = 0;  ///< steps that light_ has served, plus one; 0: there is none
  double share_ = 0;        ///< what one number of one pixel counts
};

}  // namespace stipple
