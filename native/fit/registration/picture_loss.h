#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/progress.h"
#include "data/views/view_source.h"
#include "fit/registration/moving_template.h"
#include "mesh/adapt/harmonic_light.h"
#include "mesh/adapt/mesh_renderer.h"

namespace stipple {

/// An image that a mesh is to look like, as the loss reads it.
struct TargetPicture {
  Camera camera;
  std::vector<float> pixels;  ///< [H,W,4] linear colour times coverage, and coverage
};

/// The images of views whose outlines are known, no larger than `side` pixels along their longer
/// side. The coverage is their alpha, or where they have none, where their mask is not 0. In: a
/// larger side shows finer detail and takes its square in time. Errors: kInvalidArgument for fewer
/// than two views, for one that has neither alpha nor mask (named), where none shows anything, and
/// those of load(); kCancelled.
std::vector<TargetPicture> targetPictures(const ViewSource& views, uint32_t side,
                                          Progress* progress);

/// Where the masks of images meet: the place nearest to the rays through their middles, and the
/// mean radius of balls there that look as large. Errors: kInvalidArgument where the rays are
/// parallel or the place is not before the cameras.
UnitBall ballOfPictures(std::span<const TargetPicture> pictures);

/// How unlike its images a mesh is: the mean difference of all channels of all pixels, colour and
/// coverage. Its colour is that of a white surface in light that depends on the normal alone
/// (HarmonicLight), which is found from the images again and again by least squares, so a colour
/// that all of the mesh has is a part of the light.
class PictureLoss {
 public:
  /// Keeps links, which must outlive it.
  PictureLoss(std::vector<TargetPicture> pictures, const MeshLinks& links);

  /// Adds the derivative by positions; outlines weigh `outline_weight` times. In: positions [n],
  /// metres. Out: gradient [n], per metre. Returns the loss. Errors: kCancelled. Threads and
  /// determinism: parallel; same result for any number of threads. Cost: two passes over all
  /// pixels.
  double addGradient(std::span<const Vec3d> positions, double outline_weight,
                     std::span<Vec3d> gradient);
  /// The loss alone, in the light that suits it best.
  double at(std::span<const Vec3d> positions);

  const HarmonicLight& light() const { return light_; }
  std::span<const TargetPicture> pictures() const { return pictures_; }

 private:
  struct Step;
  /// Light for what the views show. In: views of all pictures, whatever their colours are.
  void findLight(std::span<const MeshView> views, std::span<const Vec3d> normals);
  std::vector<MeshView> drawAll(std::span<const Vec3d> positions,
                                std::span<const Vec3d> colours) const;
  std::vector<Vec3d> coloursOf(std::span<const Vec3d> normals) const;

  std::vector<TargetPicture> pictures_;
  const MeshLinks& links_;
  MeshRenderer renderer_;
  HarmonicLight light_;
  bool has_light_ = false;
  double share_ = 0;  ///< what one number of one pixel counts
};

}  // namespace stipple
