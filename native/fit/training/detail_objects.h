#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/progress.h"
#include "decode/tree/hierarchy_decoder.h"
#include "fit/training/collection.h"
#include "fit/training/training_config.h"
#include "train/backend/backend_factory.h"
#include "train/detail/detail_trainer.h"
#include "train/networks/gradient_exchange.h"

namespace stipple {

/// Objects of a collection as splats of any number: cuts of the tree of a fitted cloud. That cloud
/// is the object's own coarse.ply, beside its transforms.json and where that has the object; else
/// it is made by a short fit, once, and kept in the folder of results, in the networks' cube.
class FittedObjects {
 public:
  /// Makes what is missing. Of several processes the first makes all, and the others wait. In:
  /// folder: that the collection was read from. Errors: those of reading a coarse.ply, which name
  /// it; of fits; of writing; kInvalidArgument for one without splats, or of another colour space
  /// than its images; kCancelled.
  FittedObjects(const std::shared_ptr<const BackendFactory>& backends,
                std::shared_ptr<const Collection> collection, const TrainingConfig& config,
                GradientExchange& exchange, Progress* progress = nullptr);

  const Collection& collection() const { return *collection_; }
  /// In: splats >= 1: all there are, where there are fewer.
  SplatCloud coarse(size_t object, uint64_t splats) const;

 private:
  std::shared_ptr<const Collection> collection_;
  std::vector<std::unique_ptr<const HierarchyDecoder>> trees_;  ///< by object
};

/// Some of them, for a trainer.
class FittedShare final : public DetailSource {
 public:
  FittedShare(std::shared_ptr<const FittedObjects> fitted, std::vector<size_t> objects)
      : fitted_(std::move(fitted)), objects_(std::move(objects)) {}
  size_t count() const override { return objects_.size(); }
  const ObjectViews& views(size_t index) const override {
    return *fitted_->collection().object(objects_[index])->views;
  }
  SplatCloud coarse(size_t index, uint64_t splats) const override {
    return fitted_->coarse(objects_[index], splats);
  }

 private:
  std::shared_ptr<const FittedObjects> fitted_;
  std::vector<size_t> objects_;
};

}  // namespace stipple
