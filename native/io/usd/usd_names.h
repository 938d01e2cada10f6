#pragma once

#include "data/clouds/splat_frame.h"

namespace stipple {

/// The words of OpenUSD's schema of Gaussian splats (UsdVol, from 26.03), and ours beside them.
constexpr char kUsdSplats[] = "ParticleField3DGaussianSplat";
constexpr char kUsdPositions[] = "positions";
constexpr char kUsdOrientations[] = "orientations";
constexpr char kUsdScales[] = "scales";
constexpr char kUsdOpacities[] = "opacities";
constexpr char kUsdDegree[] = "radiance:sphericalHarmonicsDegree";
constexpr char kUsdCoefficients[] = "radiance:sphericalHarmonicsCoefficients";
/// The same in half precision, which are read where those in single precision are missing.
constexpr char kUsdPositionsHalf[] = "positionsh";
constexpr char kUsdOrientationsHalf[] = "orientationsh";
constexpr char kUsdScalesHalf[] = "scalesh";
constexpr char kUsdOpacitiesHalf[] = "opacitiesh";
constexpr char kUsdCoefficientsHalf[] = "radiance:sphericalHarmonicsCoefficientsh";
/// Of the schema ColorSpaceAPI. Splats without it are of display colours, as trained ones are.
constexpr char kUsdColourSpace[] = "colorSpace:name";
constexpr char kUsdLinear[] = "lin_rec709_scene";

/// The frames that a layer's upAxis names.
constexpr Frame kUsdFrame = Frame::kRUB;       ///< "Y"
constexpr Frame kUsdFrameOfZUp = Frame::kRFU;  ///< "Z"

/// Keys of customData, written where the splats are not as those of other files.
constexpr char kUsdGroup[] = "stipple";
constexpr char kUsdAntialiasKey[] = "antialias";
constexpr char kUsdMip[] = "mip";
constexpr char kUsdFrameKey[] = "frame";

}  // namespace stipple
