#include "measure/picture_accuracy.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "measure/accuracy_choice.h"
#include "measure/accuracy_row.h"
#include "measure/image_judge.h"
#include "shot/cloud_cuts.h"

namespace stipple {

namespace {

constexpr uint64_t kBlockPixels = uint64_t{kRayBlockSide} * kRayBlockSide;
/// A setting whose picture would take more than this share of the time is drawn in part.
constexpr double kLongestShare = 0.05;

/// Blocks of pixels that are spread evenly over the picture, by the additive sequence of the
/// plastic number, which fills a square evenly at any length. Source: Roberts, The Unreasonable
/// Effectiveness of Quasirandom Sequences, 2018.
std::vector<PixelArea> spreadBlocks(const Camera& camera, uint64_t pixels) {
  const uint32_t columns = (camera.width + kRayBlockSide - 1) / kRayBlockSide;
  const uint32_t rows = (camera.height + kRayBlockSide - 1) / kRayBlockSide;
  const uint64_t all = uint64_t{columns} * rows;
  const uint64_t wanted =
      pixels == 0 ? all : std::clamp<uint64_t>((pixels + kBlockPixels - 1) / kBlockPixels, 1, all);
  constexpr double kStep[2] = {0.7548776662466927, 0.5698402909980532};
  std::vector<uint8_t> taken(all);
  std::vector<PixelArea> blocks;
  const auto take = [&](uint64_t block) {
    if (taken[block] || blocks.size() == wanted) return;
    taken[block] = 1;
    const uint32_t x0 = static_cast<uint32_t>(block % columns) * kRayBlockSide;
    const uint32_t y0 = static_cast<uint32_t>(block / columns) * kRayBlockSide;
    blocks.push_back({x0, y0, std::min(kRayBlockSide, camera.width - x0),
                      std::min(kRayBlockSide, camera.height - y0)});
  };
  for (uint64_t k = 0; k < 4 * all; ++k) {
    const double x = 0.5 + static_cast<double>(k) * kStep[0];
    const double y = 0.5 + static_cast<double>(k) * kStep[1];
    const auto column = static_cast<uint64_t>((x - std::floor(x)) * columns);
    const auto row = static_cast<uint64_t>((y - std::floor(y)) * rows);
    take(row * columns + column);
  }
  for (uint64_t block = 0; block < all; ++block) take(block);
  return blocks;
}

bool hasHarmonics(const Instances& instances) {
  return std::any_of(instances.list.begin(), instances.list.end(), [](const auto& instance) {
    return instance.cloud && instance.cloud->sh_degree > 0;
  });
}

/// What of the settings that an image can be drawn whole with is closest to the reference.
AccuracySettings standInAccuracy() {
  AccuracySettings accuracy = accuracyOf(AccuracyLevel::kFinal);
  accuracy.order = RayOrder::kResponse;
  accuracy.projection = RayProjection::kRay;
  accuracy.least_alpha = 1e-4;
  return accuracy;
}

class Measuring {
 public:
  Measuring(const ImageRendererFactory& images, const Instances& instances, const Camera& camera,
            const ShotSettings& shot, const PictureAccuracyOptions& settings, Progress& progress)
      : instances_(instances),
        camera_(camera),
        options_(shot.options),
        is_display_(compositesInDisplaySpace(instances, shot.options.blend_space)),
        settings_(settings),
        progress_(progress),
        judge_(camera.width, camera.height, is_display_,
               spreadBlocks(camera, settings.reference_pixels)),
        images_(images.makeImageRenderer()) {
    options_.with_depth = false;
    low_pass_ = options_.low_pass;
    degree_ = options_.sh_degree_limit;
  }

  MeasuredAccuracy run() {
    result_.report.width = camera_.width;
    result_.report.height = camera_.height;
    result_.report.compared_pixels = judge_.comparedPixels();
    result_.report.splat_count = splatCount(instances_);
    result_.report.thread_count = static_cast<uint32_t>(threadLimit());
    makeCuts();
    drawReference();
    drawStandIn();
    std::vector<size_t> repeated;
    for (size_t i = 0; i < settings_.accuracies.size(); ++i) {
      progress_.advance(0.4 + 0.2 * partOf(i, settings_.accuracies.size()), "Comparing settings");
      if (measureOnce(settings_.accuracies[i])) repeated.push_back(i + 1);
    }
    repeat(repeated);
    // The reference is last, as the dearest.
    std::rotate(result_.report.rows.begin(), result_.report.rows.begin() + 1,
                result_.report.rows.end());
    std::rotate(result_.accuracies.begin(), result_.accuracies.begin() + 1,
                result_.accuracies.end());
    markFront(result_.report);
    return std::move(result_);
  }

 private:
  static double partOf(size_t done, size_t all) {
    return static_cast<double>(done) / static_cast<double>(std::max<size_t>(all, 1));
  }

  /// Every share is merged before anything is timed.
  void makeCuts() {
    const Stopwatch watch;
    for (const AccuracySettings& accuracy : settings_.accuracies) {
      const bool known = std::any_of(cuts_.begin(), cuts_.end(), [&](const auto& cut) {
        return cut.first == accuracy.budget_share;
      });
      if (known || accuracy.budget_share >= 1) continue;
      Instances cut = instances_;
      cutter_.cut(cut, accuracy.budget_share, &progress_);
      cuts_.emplace_back(accuracy.budget_share, std::move(cut));
    }
    if (!cuts_.empty()) result_.report.cut_seconds = watch.seconds();
  }

  const Instances& cutFor(const AccuracySettings& accuracy) const {
    for (const auto& [share, cut] : cuts_) {
      if (share == accuracy.budget_share) return cut;
    }
    return instances_;
  }

  RenderOptions optionsFor(const AccuracySettings& accuracy) const {
    RenderOptions options = options_;
    options.low_pass = accuracy.antialiasing == Antialiasing::kMip ? LowPass::kMip : low_pass_;
    options.sh_degree_limit = std::min(degree_, accuracy.sh_degree_limit);
    return options;
  }

  void draw(const AccuracySettings& accuracy) {
    images_->render(cutFor(accuracy).list, camera_, optionsFor(accuracy), renderAccuracy(accuracy),
                    picture_);
  }

  /// Seconds of drawing only some of the blocks.
  double drawBlocks(const AccuracySettings& accuracy, std::span<const PixelArea> blocks,
                    double progress_begin, double progress_end) {
    RayOptions rays = rayOptions(renderAccuracy(accuracy));
    rays.areas = blocks;
    rays.progress_begin = progress_begin;
    rays.progress_end = progress_end;
    const Stopwatch watch;
    picture_ = renderRays(cutFor(accuracy).list, camera_, optionsFor(accuracy), rays, &progress_);
    return watch.seconds();
  }

  /// Draws the blocks, and half of them, and from both what a whole picture would take: splats are
  /// placed once, pixels follow their number. Leaves the picture of all blocks.
  double estimate(const AccuracySettings& accuracy, double progress_begin, double progress_end) {
    const std::span<const PixelArea> all = judge_.blocks();
    const auto half = all.subspan(0, all.size() / 2);
    const double middle = progress_begin + (progress_end - progress_begin) / 3;
    const uint64_t picture_pixels = uint64_t{camera_.width} * camera_.height;
    const double less = half.empty() ? 0.0 : drawBlocks(accuracy, half, progress_begin, middle);
    const double more =
        drawBlocks(accuracy, all, half.empty() ? progress_begin : middle, progress_end);
    const auto drawn = static_cast<double>(pixelsOf(all));
    const double added = drawn - static_cast<double>(pixelsOf(half));
    const double left = static_cast<double>(picture_pixels) - drawn;
    return more + std::max(0.0, more - less) / added * left;
  }

  bool comparesAll() const {
    return result_.report.compared_pixels == uint64_t{camera_.width} * camera_.height;
  }

  /// is_whole: the image that was drawn last, rather than its blocks alone.
  AccuracyRow& addRow(const AccuracySettings& accuracy, bool is_whole) {
    AccuracyRow row;
    row.name = accuracyName(accuracy);
    row.knobs = knobValues(accuracy);
    row.splat_count = splatCount(cutFor(accuracy));
    row.visible_count = picture_.visible_count;
    judge_.judge(picture_, is_whole, row);
    result_.report.rows.push_back(std::move(row));
    result_.accuracies.push_back(accuracy);
    return result_.report.rows.back();
  }

  void drawReference() {
    const AccuracySettings reference = accuracyOf(AccuracyLevel::kReference);
    double seconds = 0;
    if (comparesAll()) {
      seconds = drawBlocks(reference, judge_.blocks(), 0.0, 0.4);
    } else {
      seconds = estimate(reference, 0.0, 0.4);
    }
    judge_.setReference(picture_);
    AccuracyRow& row = addRow(reference, false);
    setSeconds({seconds}, row);
    row.is_estimated = !comparesAll();
  }

  void drawStandIn() {
    const AccuracySettings accuracy = standInAccuracy();
    if (comparesAll() || isSlow(renderAccuracy(accuracy), camera_)) return;
    draw(accuracy);
    judge_.setStandIn(picture_);
  }

  /// Returns whether the setting is to be timed again.
  bool measureOnce(const AccuracySettings& accuracy) {
    if (isSlow(renderAccuracy(accuracy), camera_) && !comparesAll()) {
      const double at = progress_.fraction();
      const double seconds = estimate(accuracy, at, at);
      if (seconds > kLongestShare * settings_.timing.most_seconds) {
        AccuracyRow& row = addRow(accuracy, false);
        setSeconds({seconds}, row);
        row.is_estimated = true;
        return false;
      }
    }
    draw(accuracy);  // and its memory grows before anything is timed
    addRow(accuracy, true);
    return true;
  }

  /// In turns, so that what else the machine does meets all alike.
  void repeat(const std::vector<size_t>& rows) {
    std::vector<std::vector<double>> times(rows.size());
    const Stopwatch whole;
    for (uint32_t round = 0; round < settings_.timing.repetitions; ++round) {
      if (round > 0 && whole.seconds() > settings_.timing.most_seconds) break;
      for (size_t k = 0; k < rows.size(); ++k) {
        progress_.advance(
            0.6 + 0.4 * partOf(round * rows.size() + k, settings_.timing.repetitions * rows.size()),
            "Timing settings");
        const Stopwatch watch;
        draw(result_.accuracies[rows[k]]);
        times[k].push_back(watch.seconds());
      }
    }
    for (size_t k = 0; k < rows.size(); ++k) {
      setSeconds(std::move(times[k]), result_.report.rows[rows[k]]);
    }
  }

  const Instances& instances_;
  const Camera& camera_;
  RenderOptions options_;
  LowPass low_pass_;
  int degree_;
  bool is_display_;
  const PictureAccuracyOptions& settings_;
  Progress& progress_;
  ImageJudge judge_;
  CloudCuts cutter_;
  std::vector<std::pair<double, Instances>> cuts_;
  std::unique_ptr<ImageRenderer> images_;
  RenderResult picture_;
  MeasuredAccuracy result_;
};

}  // namespace

std::vector<AccuracySettings> usualAccuracies(const Instances& instances, const Camera& camera) {
  std::vector<AccuracySettings> list;
  for (const auto level : {AccuracyLevel::kDraft, AccuracyLevel::kPreview, AccuracyLevel::kFinal}) {
    list.push_back(accuracyOf(level));
  }
  const auto add = [&](auto change) {
    AccuracySettings accuracy = accuracyOf(AccuracyLevel::kFinal);
    change(accuracy);
    list.push_back(accuracy);
  };
  if (hasHarmonics(instances)) add([](AccuracySettings& a) { a.sh_degree_limit = 0; });
  add([](AccuracySettings& a) { a.budget_share = 0.5; });
  add([](AccuracySettings& a) { a.budget_share = 0.25; });
  add([](AccuracySettings& a) { a.budget_share = 0.1; });
  add([](AccuracySettings& a) { a.least_alpha = 0.02; });
  add([](AccuracySettings& a) { a.least_alpha = 1e-4; });
  add([](AccuracySettings& a) { a.order = RayOrder::kResponse; });
  add([](AccuracySettings& a) { a.projection = RayProjection::kRay; });
  add([](AccuracySettings& a) {
    a.order = RayOrder::kResponse;
    a.projection = RayProjection::kRay;
  });
  list.push_back(standInAccuracy());
  add([](AccuracySettings& a) { a.precision = Precision::kDouble; });
  if (hasImagePlane(camera)) return list;
  std::vector<AccuracySettings> along_rays;
  for (AccuracySettings accuracy : list) {
    accuracy.projection = RayProjection::kRay;
    // Rays of directions are drawn in double whatever is asked for.
    accuracy.precision = Precision::kFloat;
    const std::string name = accuracyName(accuracy);
    const bool is_new =
        std::none_of(along_rays.begin(), along_rays.end(),
                     [&](const AccuracySettings& other) { return accuracyName(other) == name; });
    if (is_new) along_rays.push_back(accuracy);
  }
  return along_rays;
}

void validate(const PictureAccuracyOptions& options, const Instances& instances,
              const Camera& camera) {
  if (splatCount(instances) == 0) {
    fail(ErrorCode::kInvalidArgument, "the instances have 0 splats; measuring needs at least 1");
  }
  validate(options.timing);
  for (size_t i = 0; i < options.accuracies.size(); ++i) {
    if (options.accuracies[i].projection != RayProjection::kAffine) continue;
    requireImagePlane(camera,
                      ("options->settings[" + std::to_string(i) + "]->projection affine").c_str());
  }
}

RenderMemory measurePictureMemory(const ImageRendererFactory& images, const Instances& instances,
                                  const Camera& camera, const ShotSettings& shot,
                                  const PictureAccuracyOptions& settings) {
  RenderMemory memory = rayMemory(instances.list, camera, shot.options);
  double least_share = 1;
  for (const AccuracySettings& accuracy : settings.accuracies) {
    const RenderMemory one =
        images.imageMemory(instances.list, camera, shot.options, renderAccuracy(accuracy));
    if (one.sum() > memory.sum()) memory = one;
    least_share = std::min(least_share, accuracy.budget_share);
  }
  memory.other_bytes += CloudCuts::memoryBound(instances, least_share);
  const uint64_t pixels = uint64_t{camera.width} * camera.height;
  const uint64_t compared =
      settings.reference_pixels == 0 ? pixels : std::min(pixels, settings.reference_pixels * 2);
  memory.other_bytes += ImageJudge::memoryBound(compared, pixels, settings.accuracies.size());
  return memory;
}

MeasuredAccuracy measurePicture(const ImageRendererFactory& images, const Instances& instances,
                                const Camera& camera, const ShotSettings& shot,
                                const PictureAccuracyOptions& settings, Progress& progress) {
  return Measuring(images, instances, camera, shot, settings, progress).run();
}

}  // namespace stipple
