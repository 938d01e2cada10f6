#pragma once

#include <stipple/stipple.h>

#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "api/handles.h"
#include "train/loop/explicit_model.h"
#include "train/loop/field_model.h"
#include "train/loop/trainer.h"

namespace stipple::api {

/// StippleFitOptions as the library has them.
struct FitSettings {
  bool is_field = false;
  ExplicitModelOptions explicit_model;
  FieldModelOptions field_model;
  TrainerOptions trainer;
  uint64_t holdout = 8;
  std::string checkpoint_path;  ///< empty: none
  bool resumes = false;
};

/// Errors: kInvalidArgument, with the name of the option.
FitSettings fitSettings(const StippleFitOptions& options);

/// The pictures of views. Errors: kInvalidArgument where there are cameras alone.
std::shared_ptr<const ViewSource> sourceOf(const StippleViews& views);
/// What the data set says of its views; where it says nothing, every so many-th is held out.
FitViews splitOf(const StippleViews& views, const ViewSource& source, uint64_t holdout);

/// What a checkpoint must agree with: everything that the steps depend on.
std::string settingsText(const FitSettings& settings, const ViewSource& views);
/// Refuses texts that differ. In: path, of the checkpoint.
void requireSameSettings(const std::string& stored, const std::string& wanted,
                         const std::string& path);

/// Lowers caps until the fit stays below about this many bytes; 0: any number. Errors: kMemoryLimit
/// where one splat, or the field that is asked for, needs more.
void holdToMemory(uint64_t max_bytes, const ViewSource& views, FitSettings& settings);

/// About what a fit allocates, bytes.
uint64_t fitMemoryBound(const FitSettings& settings, const ViewSource& views);
/// About what looking at views in turn allocates: those that are kept, and one at work. Bytes.
uint64_t pictureMemoryBound(const ViewSource& views, uint64_t picture_bytes);

/// One fit: what its job works on, and what others ask of it meanwhile.
class FitSession final : public FitObserver {
 public:
  FitSession(std::shared_ptr<const BackendFactory> backends,
             std::shared_ptr<const ViewSource> views, FitViews split, FitSettings settings);

  /// The whole work, on the job's thread.
  void run(Progress& progress);

  StippleFitFigures figuresNow() const;
  const char* noteAt(uint64_t index) const;
  /// The newest preview, and a request for another.
  SeenCloud takePreview();
  void watchContributions(bool wanted) { contributions_are_wanted_ = wanted; }

  /// The trainer of a fit that has ended with something to show. Errors: kInvalidArgument.
  Trainer& ended() const;
  /// Of such a fit. May be called by several threads.
  SeenCloud decode(uint64_t budget) const;
  /// The same as a model. Errors: kUnsupported for explicit splats.
  ModelParts model() const;
  const FitSettings& settings() const { return settings_; }
  const std::string& settingsJson() const { return settings_json_; }

  void figures(const FitFigures& figures) override;
  void note(const std::string& text) override;
  bool wantsPreview() override;
  bool wantsContributions() override { return contributions_are_wanted_; }
  void preview(SplatCloud cloud, SplatQuantities seen) override;
  void save(const TensorTable& table) override;

 private:
  std::shared_ptr<const BackendFactory> backends_;
  std::shared_ptr<const ViewSource> views_;
  FitViews split_;
  FitSettings settings_;
  std::string settings_json_;
  std::unique_ptr<Trainer> trainer_;

  mutable std::mutex decode_mutex_;  ///< models decode one budget at a time
  mutable std::mutex mutex_;         ///< of what follows
  bool has_ended_ = false;
  FitFigures figures_;
  std::string stage_ = "Checking views";
  std::deque<std::string> notes_;  ///< texts stay where they are
  SeenCloud preview_;
  uint64_t preview_iteration_ = 0;
  std::atomic<bool> preview_is_wanted_{false};
  std::atomic<bool> contributions_are_wanted_{false};
};

}  // namespace stipple::api
