#include "measure/volume_accuracy.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <iterator>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "measure/accuracy_choice.h"
#include "measure/accuracy_row.h"
#include "splat/voxels/volume_sides.h"

namespace stipple {

namespace {

/// Voxel sizes, in units of the finest.
constexpr double kSizes[] = {1, 1.5, 2, 3, 4, 6, 8};

class Filling {
 public:
  Filling(const Instances& instances, const VolumeAccuracyOptions& settings, uint64_t memory_limit,
          Progress& progress)
      : instances_(instances),
        settings_(settings),
        memory_limit_(memory_limit),
        progress_(progress) {}

  AccuracyReport run() {
    AccuracyReport report;
    report.subject = AccuracySubject::kVolume;
    report.splat_count = splatCount(instances_);
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
      char name[48];
      std::snprintf(name, sizeof(name), "voxel %.4g m", volume.voxel_size);
      row.name = name;
      std::snprintf(name, sizeof(name), "%.4g m", volume.voxel_size);
      row.knobs = {{"voxel size", name}};
      row.value = volume.voxel_size;
      row.splat_count = row.visible_count = extentOf(volume).active_voxel_count;
      setErrors(differences, row);
      report.rows.push_back(std::move(row));
    }
    const Stopwatch watch;
    for (uint32_t round = 1; round < settings_.timing.repetitions; ++round) {
      if (watch.seconds() > settings_.timing.most_seconds) {
        break;
      }
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
    const double all = static_cast<double>(std::size(kSizes)) * settings_.timing.repetitions;
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
  const VolumeAccuracyOptions& settings_;
  uint64_t memory_limit_;
  Progress& progress_;
  double size_ = 0;  ///< of the finest voxels, metres; 0: not known yet
};

}  // namespace

void validate(const VolumeAccuracyOptions& options, const Instances& instances) {
  validate(options.timing);
  if (splatCount(instances) == 0) {
    fail(ErrorCode::kInvalidArgument, "the instances have 0 splats; measuring needs at least 1");
  }
}

AccuracyReport measureVolume(const Instances& instances, const VolumeAccuracyOptions& options,
                             uint64_t memory_limit, Progress& progress) {
  return Filling(instances, options, memory_limit, progress).run();
}

}  // namespace stipple
