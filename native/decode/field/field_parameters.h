#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "decode/field/feature_grid.h"
#include "decode/field/field_details.h"
#include "decode/splat_layout.h"
#include "density/octree_density.h"
#include "nn/mlp.h"

namespace stipple {

/// What an attribute field is made for.
struct FieldShape {
  RootCube root;
  bool contracted = false;  ///< FieldParameters::contracted
  int leaf_level = 8;       ///< of the anchors' octree
  SplatLayout layout;
  uint64_t least_anchors = 1024;  ///< budgets that it is trained for; others count as the nearest
  uint64_t most_anchors = 16384;
  uint64_t surface_cells = 1 << 16;  ///< leaves that it has to tell apart, about
  double starting_opacity = 0.3;     ///< of its Gaussians, below 1
  ColourSpace colour_space = ColourSpace::kDisplay;
  Antialias antialias = Antialias::kMip;
  uint64_t seed = 0;
};

/// Everything that an attribute field has learned.
struct FieldParameters {
  RootCube root;
  bool contracted = false;  ///< the outer half of the root is all around (decode/field/contraction.h)
  int leaf_level = 8;
  SplatLayout layout;
  uint64_t least_anchors = 1024;
  uint64_t most_anchors = 16384;
  ColourSpace colour_space = ColourSpace::kDisplay;
  Antialias antialias = Antialias::kMip;
  FeatureGrid features;  ///< read where an anchor is; the network's input
  FeatureGrid details;   ///< read where a Gaussian is, [kDetailChannels] or fewer
  Mlp network;

  uint64_t bytes() const;
};

/// A field that knows nothing: grey Gaussians on a lattice around each anchor, as large as the
/// anchors' spacing. Errors: kInvalidArgument for a shape out of range.
FieldParameters makeFieldParameters(const FieldShape& shape);

/// Means of the offsets to an anchor's neighbours and of their products, in units of the spacing.
constexpr size_t kNeighbourInputs = 9;
/// Of fields with all details; those with colours alone do not.
bool seesNeighbours(const FieldParameters& field);

/// Widths of the network's input and output: whole vectors, the rest is 0 and unused.
size_t fieldInputWidth(const FieldParameters& field);
size_t fieldOutputWidth(const SplatLayout& layout);

/// Refuses parts that do not fit together, for fields from a file. Errors: kFormat.
void validate(const FieldParameters& field);

/// Derivatives by all of it. Those of grids are kept by rows, as a step touches few of them.
struct FieldGradients {
  std::vector<FeatureGradient> features;
  std::vector<FeatureGradient> details;
  std::vector<LinearLayer> network;
};

}  // namespace stipple
