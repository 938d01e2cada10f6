// Based on: Kim, Jung, Park, Metropolis-Hastings Sampling for 3D Gaussian Reconstruction, NeurIPS
// 2025: importance, tries, acceptance (equation 20 with D = 1 / (1 + lambda c)), relocation as in
// 3D Gaussian Splatting as Markov Chain Monte Carlo. Differs: a splat is looked up where its centre
// is in each view, and its cues are averaged over the views that have it in their picture; what no
// view sees does not try; views that iterations before an event have drawn are not drawn again for
// it; faint splats attract tries, as the text says; offsets are turned with their splat; voxels are
// in units of the cameras' extent (published_unit.h); there is a hard cap.

#include "densify/strategies/metropolis.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "densify/parts/relocation.h"
#include "densify/published_unit.h"
#include "densify/quantities/error_maps.h"
#include "densify/quantities/splat_footprint.h"
#include "densify/quantities/voxel_counts.h"
#include "densify/state_arrays.h"
#include "densify/strategies.h"
#include "math/quaternion.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 13;

double logistic(double x) {
  return 1 / (1 + std::exp(-x));
}

Vec3d vectorOf(const float* xyz) {
  return {static_cast<double>(xyz[0]), static_cast<double>(xyz[1]), static_cast<double>(xyz[2])};
}

/// What the views of an event say of each splat.
struct ViewCues {
  std::vector<double> dissimilarity;  ///< [N] mean
  std::vector<double> difference;     ///< [N] mean
  std::vector<uint32_t> view_counts;  ///< [N] views that have its centre

  size_t size() const { return view_counts.size(); }
  void reset(size_t count) {
    dissimilarity.assign(count, 0.0);
    difference.assign(count, 0.0);
    view_counts.assign(count, 0);
  }

  void add(const Camera& camera, const SplatCloud& splats, const ErrorMaps& maps) {
    addPixels(camera, splats.positions, [&](size_t i, size_t pixel) {
      dissimilarity[i] += static_cast<double>(maps.dissimilarity[pixel]);
      difference[i] += static_cast<double>(maps.difference[pixel]);
    });
  }
  void add(const ViewStatistics& view) {
    addPixels(*view.camera, view.splats.positions, [&](size_t i, size_t pixel) {
      dissimilarity[i] += static_cast<double>(view.errors.structure[pixel]);
      difference[i] += view.errors.differenceAt(pixel);
    });
  }
  void finish() {
    for (size_t i = 0; i < size(); ++i) {
      const double views = static_cast<double>(std::max(view_counts[i], 1u));
      dissimilarity[i] /= views;
      difference[i] /= views;
    }
  }

 private:
  template <typename Add>
  void addPixels(const Camera& camera, std::span<const float> positions, const Add& add) {
    parallelFor(size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const auto place = placeInPicture(camera, vectorOf(&positions[i * 3]));
        if (!place) continue;
        add(i, place->pixel);
        ++view_counts[i];
      }
    });
  }
};

/// Views of an event: next to each other, around and around.
struct ViewBlock {
  uint64_t first, count, views;
  size_t at(uint64_t k) const { return static_cast<size_t>((first + k) % views); }
  bool has(uint64_t view) const { return view < views && (view + views - first) % views < count; }
};

/// The published program's cues: maps averaged pixel by pixel, read at the world's x and y.
class ReleasedCues {
 public:
  void add(const Camera& camera, const ErrorMaps& maps) {
    if (views_ == 0) {
      width_ = camera.width;
      height_ = camera.height;
      sums_ = maps;
    } else {
      if (camera.width != width_ || camera.height != height_) {
        fail(ErrorCode::kInvalidArgument,
             "metropolis(released=1) averages images of one size; there are " +
                 std::to_string(width_) + " x " + std::to_string(height_) + " and " +
                 std::to_string(camera.width) + " x " + std::to_string(camera.height));
      }
      for (size_t p = 0; p < sums_.difference.size(); ++p) {
        sums_.dissimilarity[p] += maps.dissimilarity[p];
        sums_.difference[p] += maps.difference[p];
      }
    }
    ++views_;
  }

  void read(const SplatCloud& splats, ViewCues& cues) const {
    const double views = static_cast<double>(std::max(views_, size_t{1}));
    for (size_t i = 0; i < cues.size(); ++i) {
      const Vec3d place = vectorOf(&splats.positions[i * 3]);
      const size_t pixel = indexOf(place.y(), height_) * width_ + indexOf(place.x(), width_);
      // Similarity, not its lack.
      cues.dissimilarity[i] = 1 - static_cast<double>(sums_.dissimilarity[pixel]) / views;
      cues.difference[i] = static_cast<double>(sums_.difference[pixel]) / views;
      cues.view_counts[i] = 1;
    }
  }

 private:
  static size_t indexOf(double coordinate, uint32_t size) {
    const double last = static_cast<double>(size) - 1;
    return static_cast<size_t>(std::clamp(coordinate * last, 0.0, last));
  }

  uint32_t width_ = 0, height_ = 0;
  ErrorMaps sums_;
  size_t views_ = 0;
};

/// A splat that has been accepted.
struct Birth {
  uint32_t parent;
  Vec3d place;
};

class MetropolisBirth final : public ControlPart {
 public:
  explicit MetropolisBirth(const MetropolisOptions& options) : options_(options) {}

  const char* name() const override { return "metropolis_birth"; }
  ControlRoles owns() const override {
    return roles(ControlRole::kMultiplication, ControlRole::kScore, ControlRole::kChildren,
                 ControlRole::kChildOpacity, ControlRole::kRecovery);
  }
  void adjustRates(LearningRates& rates) const override { rates.logit = options_.logit_rate; }
  bool removesAt(const ControlMoment&) const override { return false; }

  bool wantsSweep(const ControlMoment& moment) const override { return moment.is_event; }

  /// Views of the block that iterations draw by themselves.
  void request(const ControlMoment& moment, StatisticRequest& request) const override {
    if (moment.view && looks(moment, moment.view->index))
      request.error_maps = request.drawn_splats = true;
  }
  void observe(const ControlMoment& moment, const ViewStatistics& view) override {
    if (!looks(moment, view.view) || view.errors.structure.empty()) return;
    if (cues_.size() != view.splats.positions.size() / 3) begin(view.splats.positions.size() / 3);
    cues_.add(view);
    looked_at_.push_back(view.view);
  }

  /// And those that they do not.
  void sweep(const ControlMoment& moment, ViewEvaluator& views) override {
    if (views.viewCount() == 0) return;
    const SplatCloud& splats = views.splats();
    if (cues_.size() != splats.size() || options_.as_released) begin(splats.size());
    const ViewBlock block = blockOf(moment, views.viewCount());
    ReleasedCues released;
    for (uint64_t k = 0; k < block.count; ++k) {
      const size_t view = block.at(k);
      if (hasLookedAt(view)) continue;
      const Camera& camera = views.camera(view);
      const ErrorMaps maps =
          errorMaps(camera.width, camera.height, views.picture(view), views.target(view));
      options_.as_released ? released.add(camera, maps) : cues_.add(camera, splats, maps);
    }
    options_.as_released ? released.read(splats, cues_) : cues_.finish();
  }

  void multiply(const ControlMoment& moment, const SplatStore& store, uint64_t room,
                SplatEdit& edit) override {
    const size_t count = store.size();
    // Without a look around, opacity alone decides who tries.
    if (cues_.size() != count) {
      cues_.reset(count);
      std::fill(cues_.view_counts.begin(), cues_.view_counts.end(), 1u);
    }
    RelocatedSplats splats(store.splats());
    splats.moveDead(moment, options_.dead_opacity);
    splats.write(edit);
    std::vector<Birth> births = accepted(moment, splats, importance(splats));
    keepRoom(moment, room > count ? room - count : 0, births);
    if (births.empty()) return;
    std::vector<uint32_t> parents;
    for (const Birth& birth : births) parents.push_back(birth.parent);
    edit.append = splats.rowsOf(parents);
    for (size_t k = 0; k < births.size(); ++k) {
      for (int axis = 0; axis < 3; ++axis) {
        edit.append.positions[k * 3 + static_cast<size_t>(axis)] =
            static_cast<float>(births[k].place[axis]);
      }
    }
  }

  void edited(const ControlMoment& moment, const SplatEdit& edit, size_t count_before) override {
    if (moment.is_event || edit.keep || edit.append.size() > 0) begin(0);
    if (score_.size() == count_before) followEdit(edit, 1, 0.0f, score_);
  }

  /// Importance at the last event, 0..1.
  std::vector<float> scores() const override { return score_; }

  void put(TensorTable& table) const override {
    table["dissimilarity"] = {{cues_.size()}, cues_.dissimilarity};
    table["difference"] = {{cues_.size()}, cues_.difference};
    table["view_counts"] = {{cues_.size()}, cues_.view_counts};
    table["views"] = {{looked_at_.size()}, looked_at_};
  }
  void take(const TensorTable& table) override {
    ViewCues cues;
    cues.dissimilarity = stateSums<double>(table, "dissimilarity");
    cues.difference = stateSums<double>(table, "difference");
    cues.view_counts = stateArray<uint32_t>(table, "view_counts");
    requireAsMany(cues.dissimilarity.size(), "dissimilarity", cues.size(), "view_counts");
    requireAsMany(cues.difference.size(), "difference", cues.size(), "view_counts");
    looked_at_ = stateArray<uint64_t>(table, "views");
    cues_ = std::move(cues);
  }

 private:
  void begin(size_t count) {
    cues_.reset(count);
    looked_at_.clear();
  }
  bool hasLookedAt(uint64_t view) const {
    return std::find(looked_at_.begin(), looked_at_.end(), view) != looked_at_.end();
  }
  bool looks(const ControlMoment& moment, uint64_t view) const {
    if (options_.as_released || moment.view_count == 0 || !isWindowOfViews(moment)) return false;
    return blockOf(momentOfEvent(moment, options_.schedule), moment.view_count).has(view) &&
           !hasLookedAt(view);
  }
  /// A block that goes around and shrinks to one.
  static ViewBlock blockOf(const ControlMoment& event, uint64_t views) {
    const uint64_t count = annealed(event, views);
    return {event.iteration % views * count % views, count, views};
  }
  static uint64_t annealed(const ControlMoment& moment, uint64_t count) {
    const double left = (1 - moment.progress) * static_cast<double>(count);
    return std::max<uint64_t>(1, static_cast<uint64_t>(left));
  }
  static double between(const ControlMoment& moment, double first, double last) {
    return first + (last - first) * moment.progress;
  }

  /// [N] in 0..1; 0 for splats that no view has.
  std::vector<double> importance(const RelocatedSplats& splats) {
    const size_t count = cues_.size();
    std::vector<double> opacities(count), dissimilarity(count), difference(count);
    std::vector<uint8_t> is_seen(count);
    for (size_t i = 0; i < count; ++i) {
      // Splats that have moved are where others are: views say the same of both.
      const size_t from = splats.origin(i);
      is_seen[i] = cues_.view_counts[from] > 0;
      const double opacity = static_cast<double>(activatedOpacity(splats.logit(i)));
      opacities[i] = options_.as_released ? opacity : 1 - opacity;
      dissimilarity[i] = cues_.dissimilarity[from];
      difference[i] = cues_.difference[from];
    }
    opacities = normalisedCue(opacities, is_seen);
    dissimilarity = normalisedCue(dissimilarity, is_seen);
    difference = normalisedCue(difference, is_seen);
    std::vector<double> values(count, 0.0);
    score_.assign(count, 0.0f);
    for (size_t i = 0; i < count; ++i) {
      if (!is_seen[i]) continue;
      values[i] = logistic(options_.opacity_weight * opacities[i] +
                           options_.similarity_weight * dissimilarity[i] +
                           options_.difference_weight * difference[i]);
      score_[i] = static_cast<float>(values[i]);
    }
    return values;
  }

  std::vector<Birth> accepted(const ControlMoment& moment, const RelocatedSplats& splats,
                              const std::vector<double>& importance) const {
    const double edge = between(moment, options_.first_edge, options_.last_edge);
    VoxelCounts voxels(edge * publishedUnit(moment));
    for (size_t i = 0; i < importance.size(); ++i) voxels.add(vectorOf(splats.position(i)));
    voxels.finish();
    std::vector<Birth> births;
    const BirthBatch* const batches[] = {&options_.coarse, &options_.fine};
    for (uint64_t number = 0; number < 2; ++number) {
      const BirthBatch& batch = *batches[number];
      if (batch.tries == 0) continue;
      std::vector<uint32_t> parents =
          drawWithReplacement(moment, RandomUse::kBirthChoice, number << 32, importance,
                              static_cast<size_t>(annealed(moment, batch.tries)));
      std::sort(parents.begin(), parents.end());
      parents.erase(std::unique(parents.begin(), parents.end()), parents.end());
      const double factor = between(moment, batch.first_factor, batch.last_factor);
      for (const uint32_t parent : parents) {
        const uint64_t key = parent * uint64_t{2} + number;
        const Vec3d place = tryAt(moment, splats, parent, key, factor);
        const double chance = logistic(importance[parent] - (options_.as_released ? 0.5 : 0.0)) *
                              crowdingFactor(options_.crowding, voxels.at(place));
        const bool is_far = !(place.cwiseAbs().maxCoeff() < kFarthest);
        if (!is_far && uniform(moment, RandomUse::kBirthAcceptance, key) < chance) {
          births.push_back({parent, place});
        }
      }
    }
    return births;
  }

  Vec3d tryAt(const ControlMoment& moment, const RelocatedSplats& splats, uint32_t parent,
              uint64_t key, double factor) const {
    // The published counter of visits is emptied at every event: 1 for what was seen.
    const double visits = cues_.view_counts[splats.origin(parent)] > 0 ? 1 : 0;
    const double shrink = factor / (1 + std::log1p(visits));
    Vec3d offset;
    for (uint64_t axis = 0; axis < 3; ++axis) {
      const double scale = static_cast<double>(activatedScale(splats.logScales(parent)[axis]));
      const double least = kLeastDeviation * publishedUnit(moment);
      const uint64_t number = (key * 3 + axis) * 2;
      offset[static_cast<int>(axis)] =
          std::max(scale * shrink, least) *
          normalOf(uniform(moment, RandomUse::kBirthPlace, number),
                   uniform(moment, RandomUse::kBirthPlace, number + 1));
    }
    const Vec3d place = vectorOf(splats.position(parent));
    if (options_.as_released) return place + offset;
    return place + rotationFromQuaternion<double>(splats.rotation(parent)) * offset;
  }

  static double uniform(const ControlMoment& moment, RandomUse use, uint64_t index) {
    return unitDouble(keyedBits(mixBits(moment.seed) ^ moment.iteration, use, index));
  }

  /// Some of them, by chance, where there is no room for all.
  static void keepRoom(const ControlMoment& moment, uint64_t room, std::vector<Birth>& births) {
    if (births.size() <= room) return;
    std::vector<uint32_t> rows(births.size());
    for (uint32_t k = 0; k < rows.size(); ++k) rows[k] = k;
    const std::vector<double> weights(births.size(), 1.0);
    const std::vector<uint32_t> drawn = drawWithoutReplacement(
        moment, RandomUse::kDensifyChoice, rows, weights, static_cast<size_t>(room));
    std::vector<Birth> kept;
    for (const uint32_t k : drawn) kept.push_back(births[k]);
    births = std::move(kept);
  }

  static constexpr double kLeastDeviation = 1e-6;  ///< published units
  static constexpr double kFarthest = 1e30;        ///< metres

  MetropolisOptions options_;
  ViewCues cues_;                    ///< of the next event: sums, and means from its sweep on
  std::vector<uint64_t> looked_at_;  ///< views in them
  std::vector<float> score_;         ///< [N]
};

}  // namespace

double crowdingFactor(double lambda, size_t count) {
  return 1 / (1 + lambda * static_cast<double>(count));
}

std::vector<double> normalisedCue(const std::vector<double>& values,
                                  const std::vector<uint8_t>& counts) {
  double sum = 0, number = 0;
  for (size_t i = 0; i < values.size(); ++i) {
    if (counts[i]) {
      sum += values[i];
      ++number;
    }
  }
  std::vector<double> normalised(values.size(), 0.0);
  if (number == 0) return normalised;
  const double mean = sum / number;
  double squares = 0;
  for (size_t i = 0; i < values.size(); ++i) {
    if (counts[i]) squares += (values[i] - mean) * (values[i] - mean);
  }
  // A cue that is the same everywhere but for rounding must not be blown up.
  const double deviation = std::max(std::sqrt(squares / number), 1e-6 * std::abs(mean));
  if (!(deviation > 0)) return normalised;
  for (size_t i = 0; i < values.size(); ++i) {
    if (counts[i]) normalised[i] = (values[i] - mean) / deviation;
  }
  return normalised;
}

ControlAssembly metropolisControl(const MetropolisOptions& options) {
  ControlAssembly assembly;
  assembly.schedule = options.schedule;
  addPart(assembly, std::make_unique<MetropolisBirth>(options));
  addPart(assembly, makeSizeRegulariser(options.regulariser));
  return assembly;
}

ControlAssembly metropolisControl(StrategySettings& settings) {
  MetropolisOptions options;
  options.coarse.tries = settings.count("coarse", options.coarse.tries);
  options.fine.tries = settings.count("fine", options.fine.tries);
  options.crowding = settings.number("crowding", options.crowding, 0, 1e6);
  const double edge = settings.number("edge", options.first_edge, 1e-6, 1e6);
  options.last_edge *= edge / options.first_edge;
  options.first_edge = edge;
  options.as_released = settings.flag("released", options.as_released);
  return metropolisControl(options);
}

}  // namespace stipple
