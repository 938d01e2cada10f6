#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "api/accuracy_measure.h"
#include "api/guard.h"
#include "api/handles.h"
#include "api/instances.h"
#include "api/job.h"
#include "api/volume.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "io/reports/fit_report.h"
#include "splat/voxels/volume_sides.h"
#include "splat/voxels/voxelize.h"

using namespace stipple;
using namespace stipple::api;

namespace {

/// Voxel sizes, in units of the finest.
constexpr double kSizes[] = {1, 1.5, 2, 3, 4, 6, 8};

struct VolumeMeasuring {
  VoxelizeOptions finest;
  uint32_t repetitions;
  double most_seconds;
};

VolumeMeasuring measuringFrom(const StippleVoxelizeOptions* finest,
                              const StippleVolumeAccuracyOptions* options) {
  StippleVolumeAccuracyOptions defaults;
  stipple_volume_accuracy_options_init(&defaults);
  const StippleVolumeAccuracyOptions given = completed(options, defaults, "options");
  if (given.repetitions < 1 || given.repetitions > 1000) {
    fail(ErrorCode::kInvalidArgument,
         "options->repetitions is " + std::to_string(given.repetitions) + "; 1 to 1000 is allowed");
  }
  if (!(given.most_seconds > 0 && std::isfinite(given.most_seconds))) {
    fail(ErrorCode::kInvalidArgument, "options->most_seconds is " +
                                          std::to_string(given.most_seconds) +
                                          " s; more than 0 is allowed");
  }
  return {voxelizeOptionsFrom(finest), given.repetitions, given.most_seconds};
}

uint64_t voxelsOf(const SparseVolume& volume) {
  return static_cast<uint64_t>(std::count_if(volume.density.begin(), volume.density.end(),
                                             [](float density) { return density > 0; }));
}

/// A setting that is unknown, as far as pictures are concerned.
AccuracyResult withoutSettings(AccuracyReport report) {
  StippleAccuracy none = {};
  none.struct_size = sizeof(none);
  std::vector<StippleAccuracy> accuracies(report.rows.size(), none);
  return {std::move(report), std::move(accuracies)};
}

class Filling {
 public:
  Filling(const Instances& instances, const VolumeMeasuring& settings, uint64_t memory_limit,
          Progress& progress)
      : instances_(instances),
        settings_(settings),
        memory_limit_(memory_limit),
        progress_(progress) {}

  AccuracyReport run() {
    AccuracyReport report;
    report.subject = AccuracySubject::kVolume;
    report.splat_count = splatsOf(instances_);
    report.thread_count = static_cast<uint32_t>(threadLimit());
    std::vector<std::vector<double>> times(std::size(kSizes));
    double seconds = 0;
    std::array<VolumeSide, 3> finest;
    // The finest comes first: it says how large the voxels are, and judges the others.
    for (size_t i = 0; i < std::size(kSizes); ++i) {
      const SparseVolume volume = filled(i, 0, seconds);
      times[i].push_back(seconds);
      if (i == 0) {
        size_ = volume.voxel_size;
        finest = sidesOf(volume);
      }
      std::vector<float> differences = sideDifferences(i == 0 ? finest : sidesOf(volume), finest);
      report.compared_pixels = differences.size() / 4;
      AccuracyRow row;
      const std::string size = numberText(volume.voxel_size, 4) + " m";
      row.name = "voxel " + size;
      row.knobs = {{"voxel size", size}};
      row.value = volume.voxel_size;
      row.splat_count = row.visible_count = voxelsOf(volume);
      setErrors(differences, row);
      report.rows.push_back(std::move(row));
    }
    const Stopwatch watch;
    for (uint32_t round = 1; round < settings_.repetitions; ++round) {
      if (watch.seconds() > settings_.most_seconds) break;
      for (size_t i = 0; i < std::size(kSizes); ++i) {
        filled(i, round, seconds);
        times[i].push_back(seconds);
      }
    }
    for (size_t i = 0; i < times.size(); ++i) setSeconds(std::move(times[i]), report.rows[i]);
    // As the reference of pictures, the finest is last.
    std::reverse(report.rows.begin(), report.rows.end());
    markFront(report);
    return report;
  }

 private:
  SparseVolume filled(size_t place, uint32_t round, double& seconds) {
    const double all = static_cast<double>(std::size(kSizes)) * settings_.repetitions;
    const double done = static_cast<double>(round * std::size(kSizes) + place);
    // A volume has stages of its own, which would come again with every one.
    progress_.advance(done / all, "Filling volumes");
    VoxelizeOptions options = settings_.finest;
    if (size_ > 0) options.voxel_size = size_ * kSizes[place];
    const Stopwatch watch;
    SparseVolume volume = voxelize(instances_.list, options, memory_limit_);
    seconds = watch.seconds();
    return volume;
  }

  const Instances& instances_;
  const VolumeMeasuring& settings_;
  uint64_t memory_limit_;
  Progress& progress_;
  double size_ = 0;  ///< of the finest voxels, metres; 0: not known yet
};

}  // namespace

extern "C" {

void stipple_volume_accuracy_options_init(StippleVolumeAccuracyOptions* options) {
  if (!options) return;
  *options = {};
  options->struct_size = sizeof(StippleVolumeAccuracyOptions);
  options->repetitions = 5;
  options->most_seconds = 60;
}

StippleStatus stipple_volume_accuracy_start(StippleContext* context,
                                            const StippleInstance* instances, uint64_t count,
                                            const StippleVoxelizeOptions* finest,
                                            const StippleVolumeAccuracyOptions* options,
                                            StippleJob** job) {
  return guarded([&] {
    require(context, "context");
    require(job, "job");
    Instances placed = instancesFrom(instances, count);
    const VolumeMeasuring settings = measuringFrom(finest, options);
    if (splatsOf(placed) == 0) {
      fail(ErrorCode::kInvalidArgument, "the instances have 0 splats; measuring needs at least 1");
    }
    const uint64_t limit = context->state->memory_limit_bytes;
    *job = startJob(context->state,
                    [placed = std::move(placed), settings, limit](Progress& progress) -> JobResult {
                      return std::make_shared<const AccuracyResult>(
                          withoutSettings(Filling(placed, settings, limit, progress).run()));
                    });
  });
}

StippleStatus stipple_fit_accuracy_report(const char* path_utf8, StippleAccuracyReport** report) {
  return guarded([&] {
    const std::string path = &require(path_utf8, "path_utf8");
    require(report, "report") = new StippleAccuracyReport{
        std::make_shared<const AccuracyResult>(withoutSettings(readFitAccuracy(path)))};
  });
}

}  // extern "C"
