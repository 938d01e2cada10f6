#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/progress.h"
#include "data/views/view_source.h"
#include "fit/registration/moving_template.h"

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

}  // namespace stipple
