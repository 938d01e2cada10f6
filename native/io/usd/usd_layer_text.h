#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "data/clouds/splat_cloud.h"

namespace stipple {

/// Takes the text of a layer, piece by piece.
using UsdSink = std::function<void(const std::string& text)>;

/// An array attribute of a prim of splats.
struct UsdArray {
  const char* type;  ///< "point3f[]"
  const char* name;
  std::vector<float> SplatCloud::*values;
  size_t width;  ///< numbers of an element
  size_t row;    ///< numbers of a splat
  bool is_half;  ///< rounded to half precision
};

/// The arrays of splats of a degree, in the order in which they are written. In: halves, for all
/// but positions in half precision.
std::array<UsdArray, 5> usdArrays(int sh_degree, bool halves);

/// Refuses a cloud with numbers that half precision does not reach. In: path, in the message.
/// Errors: kUnsupported.
void requireHalves(const SplatCloud& cloud, const std::string& path);

/// The first lines of a layer. In: frame, whose up axis the layer has; prim, the name of the first
/// one; times, lines of the layer's metadata.
std::string usdMetadata(Frame frame, const std::string& prim, const std::string& times);

/// A prim of splats up to the attributes with values for each splat. In: like, whose frame, colour
/// space, filter and degree it has.
std::string usdPrimHead(const SplatCloud& like, const std::string& name);

/// Both, for a layer of one prim.
std::string usdLayerHead(const SplatCloud& like, const std::string& times);

/// "[(...), (...)]": corners of a box with all splats, whichever way they are turned.
std::string usdExtent(const SplatCloud& cloud);

/// The elements of an array, those of each splat on a line of their own. Blocks of rows become text
/// on all threads. In: written, called with the number of rows after each piece.
void putUsdRows(const UsdArray& array, const SplatCloud& cloud, const UsdSink& sink,
                const std::function<void(size_t rows)>& written);

}  // namespace stipple
