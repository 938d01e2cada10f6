#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

#include "base/random.h"
#include "data/views/memory_view_source.h"
#include "train/backend/render_backend.h"
#include "train/loop/fit_model.h"

namespace stipple::bench {

/// Points of a ball, as many as make an octree of some size, and one picture of another colour.
class BallViews {
 public:
  BallViews(size_t points, uint32_t size) : views_(ColourSpace::kDisplay) {
    PointSet set;
    for (size_t i = 0; i < points; ++i) {
      double p[3];
      double length = 0;
      for (size_t a = 0; a < 3; ++a) {
        p[a] = unitDouble(keyedBits(1, RandomUse::kFieldStart, 3 * i + a)) - 0.5;
        length += p[a] * p[a];
      }
      for (const double value : p) {
        set.positions.push_back(static_cast<float>(value / std::sqrt(length)));
      }
      set.opacities.push_back(1.0f);
      set.colours.insert(set.colours.end(), 3, 0.5f);
    }
    views_.setPoints(set);
    Camera camera;
    camera.width = camera.height = size;
    camera.fx = camera.fy = size;
    camera.cx = camera.cy = 0.5 * size;
    camera.world_to_camera(2, 3) = 3.0;
    picture_.width = picture_.height = size;
    picture_.colour.assign(size_t{3} * size * size, 0.3f);
    views_.add(camera, picture_);
  }

  StepReport step(FitModel& model, uint64_t iteration) const {
    FitMoment moment;
    moment.iteration = iteration;
    moment.iterations = 2 * iteration;  // so always in the stage that does most
    StepView view;
    view.camera = &views_.camera(0);
    view.target = picture_.colour.data();
    return model.step(moment, view, nullptr, nullptr);
  }

  const MemoryViewSource& views() const { return views_; }
  const ViewPicture& picture() const { return picture_; }

 private:
  MemoryViewSource views_;
  ViewPicture picture_;
};

/// The passes of explicit splats that look at a ball, for a ratio: forward, loss, backward, step.
class ExplicitPasses {
 public:
  ExplicitPasses(const BallViews& ball, const SplatCloud& splats, StatisticRequest request)
      : ball_(ball), request_(std::move(request)), backend_(makeCpuBackend()) {
    backend_->upload(splats);
    options_.with_depth = false;
    step_.learning_rates.fill(1e-9);
  }
  void operator()() const {
    backend_->forward(ball_.views().camera(0), options_);
    backend_->loss(ball_.picture().colour, {});
    backend_->backward(request_);
    backend_->step(step_);
  }

 private:
  const BallViews& ball_;
  StatisticRequest request_;
  std::unique_ptr<RenderBackend> backend_;
  RenderOptions options_;
  StepOptions step_;
};

}  // namespace stipple::bench
