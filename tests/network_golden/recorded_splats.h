#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "density/anchor_sampling.h"
#include "network_golden/golden_file.h"
#include "network_golden/stage_report.h"

namespace stipple {

/// The uniform numbers that anchors of a file were drawn by: level by level, then their places in
/// the leaves.
std::vector<double> recordedUniforms(const GoldenFile& file);

/// The leaves that the file's points lie in, as Morton codes.
std::vector<int64_t> recordedLeaves(const GoldenFile& file);

/// The file's points as anchors, for networks that are run in fewer bits: they would draw others.
AnchorSet recordedAnchors(const GoldenFile& file);

/// Compares a cloud with the file's Gaussians. In: stem: what stages begin with ("decoded ").
void compareSplats(const std::string& stem, const GoldenFile& file, const SplatCloud& cloud,
                   StageTolerance tolerance, StageReport& report);

}  // namespace stipple
