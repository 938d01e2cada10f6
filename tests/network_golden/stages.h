#pragma once

#include "network_golden/golden_file.h"
#include "network_golden/stage_report.h"

namespace stipple {

// Each runs all stages of its kind that the file has numbers for, and leaves the others out.

/// From an image to the condition of a flow network.
void encoderStages(const GoldenFile& file, StageReport& report);
/// The flow network and its sampler.
void flowStages(const GoldenFile& file, StageReport& report);
/// From a latent to splats.
void decoderStages(const GoldenFile& file, StageReport& report);
/// From an image and a seed to splats; of recorded numbers only those that anchors are drawn by.
void wholeStages(const GoldenFile& file, StageReport& report);
/// Derivatives of networks that are trained; always in float32, with the weights that the file has.
void trainingStages(const GoldenFile& file, StageReport& report);
/// The same of the flow network.
void flowTrainingStages(const GoldenFile& file, StageReport& report);
/// Points with features that become finer points, and their derivatives.
void detailStages(const GoldenFile& file, StageReport& report);
/// What the optimiser does with derivatives.
void optimiserStages(const GoldenFile& file, StageReport& report);

}  // namespace stipple
