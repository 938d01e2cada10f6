#pragma once

#include <memory>

#include "densify/control_part.h"

namespace stipple {

/// As the released program of TAD-GS has it.
constexpr TimeStretch kPublishedStretch = {50, 0.7};

/// Time is stretched about the moment of each splat that moves, so that its path and its fading
/// have their detail where it is seen. Owns kTime; nothing where nothing moves.
/// Source: Sandu, Pathak, Soundararajan, TAD-GS, arXiv 2606.23212 (temporal offset warping).
std::unique_ptr<ControlPart> makeOffsetWarp(const TimeStretch& stretch = kPublishedStretch);

}  // namespace stipple
