#pragma once

#include <memory>

#include "decode/field/field_decoder.h"
#include "density/learned_draws.h"
#include "density/octree_density.h"
#include "model/splat_model.h"

namespace stipple {

/// The kind "field": learned from views, a density and a field of attributes.
/// In: draws: how anchors were drawn while it learned.
std::shared_ptr<const SplatModel> makeFieldSplats(std::shared_ptr<const OctreeDensity> density,
                                                  std::shared_ptr<const FieldParameters> field,
                                                  const LearnedDraws& draws, ModelNotes notes = {});

}  // namespace stipple
