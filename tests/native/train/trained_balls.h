#pragma once

#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "train/networks/autoencoder_trainer.h"
#include "train/trained_ball.h"

// A collection of balls for trainers.

namespace stipple {

/// Balls of other colours.
class Balls : public ObjectSource {
 public:
  explicit Balls(size_t count) {
    for (size_t i = 0; i < count; ++i) {
      auto object = std::make_shared<TrainingObject>(ball());
      std::vector<ObjectView> views;
      for (size_t view = 0; view < object->views->count(); ++view) {
        views.push_back(object->views->view(view));
        for (float& value : views.back().image) value *= 1 - 0.2f * static_cast<float>(i);
      }
      object->views = std::make_shared<const KeptViews>(std::move(views));
      objects_.push_back(std::move(object));
    }
  }
  size_t count() const override { return objects_.size(); }
  std::shared_ptr<const TrainingObject> object(size_t index) const override {
    return objects_[index];
  }
  TrainingObject& at(size_t index) { return *objects_[index]; }

 private:
  std::vector<std::shared_ptr<TrainingObject>> objects_;
};

}  // namespace stipple
