#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/progress.h"
#include "fit/training/normalised_views.h"
#include "train/networks/autoencoder_trainer.h"

namespace stipple {

struct CollectionOptions {
  /// Points of an object that the encoder reads, 1 to kMostEncodedPoints, spread evenly over those
  /// that there are. All are its surface.
  uint64_t points = 4096;
  /// Of images that stay in memory; others are read again.
  uint64_t image_bytes = uint64_t{1} << 30;
};

constexpr uint64_t kMostEncodedPoints = 16384;

/// The points of an object as networks read them, which is what is encoded: in the unit cube 0..1,
/// with display colours from -1 to 1. In: surface, in the cube around the origin. Errors:
/// kInvalidArgument for points without colours.
TrainingObject readTrainingPoints(const PointSet& surface, uint64_t points);

/// A folder of objects: each subfolder, at any depth, with a transforms.json has the views of one.
/// What cannot be learned from is left out with a reason.
class Collection {
 public:
  /// Looks at all objects and all images once. Errors: kIo for a folder that cannot be read;
  /// kInvalidArgument for one without an object that can be learned from, with the first reason;
  /// kCancelled.
  Collection(const std::string& folder, const CollectionOptions& options,
             Progress* progress = nullptr);

  size_t count() const { return objects_.size(); }
  /// The way from the collection's folder: "rocks/0017".
  const std::string& name(size_t object) const { return objects_[object].name; }
  const std::shared_ptr<const NormalisedViews>& views(size_t object) const {
    return objects_[object].views;
  }
  /// Its views are read when they are looked at. Errors of that: those of reading images.
  const std::shared_ptr<const TrainingObject>& object(size_t object) const {
    return objects_[object].points;
  }
  /// One sentence on each object that was left out.
  const std::vector<std::string>& notes() const { return notes_; }

 private:
  struct Object {
    std::string name;
    std::shared_ptr<const NormalisedViews> views;
    std::shared_ptr<const TrainingObject> points;
  };

  std::vector<Object> objects_;
  std::vector<std::string> notes_;
};

/// Objects that are learned from, and others that judge.
struct ObjectSplit {
  std::vector<size_t> learned_from, held_out;
  /// Those that judge: the ones that are learned from where none is held out.
  const std::vector<size_t>& judging() const { return held_out.empty() ? learned_from : held_out; }
};
/// Every `every`-th object is held out; 0: none.
ObjectSplit splitObjects(size_t count, uint64_t every);
/// `wanted` of them, evenly; all where there are no more.
std::vector<size_t> evenly(const std::vector<size_t>& of, size_t wanted);

/// Some objects of a collection, for a trainer.
class CollectionShare final : public ObjectSource {
 public:
  CollectionShare(std::shared_ptr<const Collection> collection, std::vector<size_t> objects)
      : collection_(std::move(collection)), objects_(std::move(objects)) {}
  size_t count() const override { return objects_.size(); }
  std::shared_ptr<const TrainingObject> object(size_t index) const override {
    return collection_->object(objects_[index]);
  }

 private:
  std::shared_ptr<const Collection> collection_;
  std::vector<size_t> objects_;
};

/// What all processes of a training must have the same of, or they would learn apart. Errors: those
/// of requireSame().
void requireSameTraining(GradientExchange& exchange, const std::string& settings,
                         const Collection& collection, uint64_t taken);

}  // namespace stipple
