#pragma once

#include <cstdint>
#include <string>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "io/splats/splat_format.h"

namespace stipple {

/// True for a PLY whose splats are packed in chunks, and for any other PLY.
bool startsAsCompressedPly(const SplatFileStart& start);
bool startsAsPly(const SplatFileStart& start);

/// Reads a 3DGS PLY: any property order, number types, text or binary of either byte order, degrees
/// 0 to 4; properties and elements that a splat does not need are passed over.
SplatCloud readPlySplats(const std::string& path, Progress* progress);

/// Writes x y z nx ny nz f_dc f_rest opacity scale rot, float32 (the order that the first 3DGS
/// viewers take for granted), little-endian or as text.
void writePlySplats(const SplatCloud& cloud, const std::string& path,
                    const SplatWriteOptions& options, Progress* progress);

/// About how many bytes that is, of numbers and text alike.
double estimatePlySplats(uint64_t count, int degree, const SplatWriteOptions& options);

/// Reads a compressed PLY as PlayCanvas has it: chunks of 256 splats, harmonics to degree 3.
SplatCloud readCompressedPly(const std::string& path, Progress* progress);

/// Writes a compressed PLY; the splats are put in Morton order.
void writeCompressedPly(const SplatCloud& cloud, const std::string& path,
                        const SplatWriteOptions& options, Progress* progress);

double estimateCompressedPly(uint64_t count, int degree, const SplatWriteOptions& options);

/// Names of the colour spaces in files that carry one.
constexpr char kColourSpaceDisplay[] = "srgb_rec709_display";
constexpr char kColourSpaceLinear[] = "lin_rec709_display";

/// Written for opacity 0 and scale 0, whose logit and logarithm are infinite: the sigmoid and the
/// exponential of -104 are the smallest numbers that round to 0 in float32, so both come back as 0.
constexpr float kPlyZero = -104.0f;
/// Written for opacity 1: its sigmoid rounds to 1 in float32.
constexpr float kPlyOpaque = 20.0f;
/// The largest float32 whose exponential is a float32 too.
constexpr float kPlyLargestLogScale = 88.72283f;

}  // namespace stipple
