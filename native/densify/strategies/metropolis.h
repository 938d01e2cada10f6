#pragma once

#include "densify/control_part.h"
#include "densify/parts/size_regulariser.h"

namespace stipple {

class StrategySettings;

/// Splats that try to be born at one event. Offsets are of their parent's scales.
struct BirthBatch {
  uint64_t tries = 0;  ///< at the first event; falls to 1 at the last
  double first_factor = 1;
  double last_factor = 1;
};

/// Defaults: as published.
struct MetropolisOptions {
  EventSchedule schedule;
  double dead_opacity = 0.005;  ///< splats that are at most this opaque move
  BirthBatch coarse{4500, 10, 5};
  BirthBatch fine{16000, 2, 1};
  double opacity_weight = 0.8;     ///< of the cues, each over its deviation
  double similarity_weight = 0.5;  ///< of 1 - SSIM
  double difference_weight = 0.5;
  double crowding = 5;  ///< lambda: a birth beside c splats is accepted 1 / (1 + lambda c) as often
  double first_edge = 0.02;  ///< of voxels, published units
  double last_edge = 0.005;
  double logit_rate = 0.025;
  SizeRegulariserOptions regulariser;
  /// As the published program is, where it is not what the publication says: pixels are looked up
  /// at the world's x and y, similarity and opacity count as if they were errors, offsets are not
  /// turned with their splat, and the acceptance is lower. All views must have one size.
  bool as_released = false;
};

/// Splats are born by tries that views accept: "metropolis". Where pictures are wrong, splats try
/// to have copies around them, and succeed where there is room; faint ones move to opaque ones.
/// Sweep: at every event the pictures of all views at the start of the fit, of one at the end.
ControlAssembly metropolisControl(const MetropolisOptions& options = {});
/// With what the user sets: coarse, fine (tries), crowding, edge (of the first voxels), released.
ControlAssembly metropolisControl(StrategySettings& settings);

/// 1 / (1 + lambda c).
double crowdingFactor(double lambda, size_t count);

/// Cues over their deviation: (x - mean) / deviation, 0 where they do not differ by more than
/// rounding. In: values, and which of them count; those that do not become 0.
std::vector<double> normalisedCue(const std::vector<double>& values,
                                  const std::vector<uint8_t>& counts);

}  // namespace stipple
