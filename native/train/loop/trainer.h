#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "data/clouds/splat_quantities.h"
#include "data/fit_history.h"
#include "data/tensor_table.h"
#include "data/views/view_source.h"
#include "train/loop/fit_model.h"
#include "train/loop/held_out.h"
#include "train/loop/picture_store.h"
#include "train/loop/view_evaluator.h"
#include "train/loop/view_order.h"

namespace stipple {

/// What stands behind the transparent parts of views. Views without alpha stand before black, or
/// white where that is chosen.
enum class BackgroundPolicy : uint32_t {
  kBlack = 0,
  kWhite = 1,
  kRandom = 2,  ///< another colour in every step: coverage shows whatever the colours are
};

constexpr uint64_t kMaxFitIterations = 10'000'000;

struct TrainerOptions {
  uint64_t iterations = 2000;  ///< 1..kMaxFitIterations; schedules scale with it
  BackgroundPolicy background = BackgroundPolicy::kRandom;
  uint64_t seed = 0;
  uint64_t max_splats = 0;                     ///< hard cap of the count; 0: none
  uint64_t picture_bytes = uint64_t{1} << 30;  ///< of pictures kept in memory; others are streamed
  bool coarse_to_fine = false;                 ///< the first steps look at images of fewer pixels
  double ssim_share = 0.2;                     ///< of the loss of views that are drawn in between
  uint64_t measure_interval = 0;     ///< iterations; 0: a twentieth of the fit, at least 100
  uint64_t checkpoint_interval = 0;  ///< iterations; 0: none
  double checkpoint_seconds = 0;     ///< since the last one; 0: none
};

/// How a fit is doing.
struct FitFigures {
  uint64_t iteration = 0;  ///< that is done
  uint64_t iterations = 0;
  uint64_t splat_count = 0;
  const char* stage = "";
  double loss = 0;                  ///< mean of the last 50 iterations
  std::optional<double> psnr;       ///< dB, as measured last
  std::optional<double> best_psnr;  ///< of the result if the fit ended now
  /// The same of the pixels in which something moves, where cameras that stand still tell them.
  std::optional<double> best_moving_psnr;
  uint64_t best_iteration = 0;
  double seconds = 0;       ///< since run() began
  double seconds_left = 0;  ///< at the pace of the last iterations
  /// Of the whole run, from its first 20 steps; empty before.
  std::optional<double> estimated_seconds;
  std::optional<uint64_t> estimated_bytes;
};

/// Who follows a fit. Called on the thread of run(), between steps.
class FitObserver {
 public:
  virtual ~FitObserver() = default;
  virtual void figures(const FitFigures&) {}
  /// One sentence on something that the user should know; the fit goes on.
  virtual void note(const std::string&) {}
  virtual bool wantsPreview() { return false; }
  virtual bool wantsContributions() { return false; }  ///< with previews
  /// Seconds that previews of splats that move show; empty: the begin of their clip.
  virtual std::optional<double> previewTime() { return std::nullopt; }
  /// The splats as they are now, where they were wanted, and what density control sees of them.
  virtual void preview(SplatCloud, SplatQuantities) {}
  /// To be kept for restore(). Errors become notes: the fit goes on.
  virtual void save(const TensorTable&) {}
};

/// How run() ended.
enum class FitEnd { kWhole, kStopped };

/// Trains a model on views: chooses views, keeps their pictures, measures on held-out ones, keeps
/// the state that shows a fixed few of those that it learns from best, saves and goes on. The same
/// for every kind of model. Determinism: the same views, options and model give the same bits, for
/// any number of threads, any limit of memory and wherever the fit was stopped and restored in
/// between.
class Trainer {
 public:
  /// In: backends: for what draws between steps, for this call; split: disjoint, of `views`;
  /// training: at least one view. Errors: kInvalidArgument for options out of range or no views.
  Trainer(const BackendFactory& backends, std::shared_ptr<const ViewSource> views, FitViews split,
          std::unique_ptr<FitModel> model, const TrainerOptions& options);
  ~Trainer();

  /// Takes all steps that are left, until progress is cancelled; then gives the model the state
  /// that did best on some of the views it learned from, evenly chosen, and measures it at all its
  /// budgets on held-out views, which choose nothing. Where there are too few views to hold any
  /// out, those of training are measured.
  /// Errors: of a view that cannot be loaded, and of a step, after the best has been brought back:
  /// the model is as good as if the fit had been cancelled.
  FitEnd run(FitObserver& observer, Progress* progress = nullptr);

  /// Iterations that are done.
  uint64_t iteration() const { return iteration_; }
  FitModel& model() { return *model_; }
  const FitHistory& history() const { return history_; }
  /// What density control has seen of the result: of splats(0) once run() has ended; contributions
  /// over kContributionViews views.
  const SplatQuantities& seen() const { return seen_; }

  /// For a checkpoint, while run() is under way or before. Errors of restore: kFormat for a table
  /// of another fit or with parts missing.
  TensorTable state() const;
  void restore(const TensorTable& state);

  uint64_t memoryBytes() const;  ///< held now, about

 private:
  struct Pace;

  size_t viewOf(uint64_t iteration);
  void step(Pace& pace);
  FitMoment momentOf(uint64_t iteration) const;
  bool measureIsDue() const;
  void measure();
  FitMeasure measureOf(uint64_t budget, std::span<const size_t> views);
  SplatsOverTime splatsOf(uint64_t budget);
  void save(FitObserver& observer, Pace& pace);
  void report(FitObserver& observer, const Pace& pace) const;
  void keepBest();
  void measureBudgets();
  SplatQuantities look(size_t most_views);
  void backgroundOf(uint64_t iteration, double background[3]) const;
  uint64_t measureInterval() const;
  uint32_t reductionAt(uint64_t iteration, uint64_t pixel_count) const;
  double stepsLeft(uint64_t iteration) const;

  TrainerOptions options_;
  PictureStore pictures_;
  FitViews split_;
  std::vector<size_t> measured_;  ///< views, while it runs
  std::vector<size_t> choosing_;  ///< views that the best state is chosen by
  std::unique_ptr<FitModel> model_;
  double extent_;  ///< of the cameras that are learned from, and their centre
  Vec3d centre_ = Vec3d::Zero();
  ViewOrder order_;
  ViewMeasure measure_;
  std::unique_ptr<FitViewEvaluator> evaluator_;
  TargetPicture target_;
  uint32_t reduction_ = 1;  ///< of the target
  const char* stage_ = "";

  uint64_t iteration_ = 0;
  uint64_t foggy_until_ = 0;  ///< iteration from which opacities that were lowered show again
  FitHistory history_;
  SplatQuantities seen_;
  /// Of history_.best_iteration, where that is not the present one.
  std::optional<TensorTable> best_;
};

}  // namespace stipple
