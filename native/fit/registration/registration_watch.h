#pragma once

#include <atomic>
#include <memory>
#include <mutex>

#include "data/meshes/tri_mesh.h"

namespace stipple {

/// Between a registration and who looks at it while it runs: the shape that it has so far, and the
/// wish to end with that. Every member may be called by any thread.
class RegistrationWatch {
 public:
  /// No further step is taken; the mesh of the steps that were taken is the result.
  void finish() { wants_end_.store(true, std::memory_order_relaxed); }
  /// The newest shape, which is given once; null: there is none that was not given yet. Asks for
  /// the next one, so shapes are made at the pace that they are taken. Never waits for a step.
  std::shared_ptr<TriMesh> takeShape();

  bool wantsEnd() const { return wants_end_.load(std::memory_order_relaxed); }
  bool wantsShape() const { return wants_shape_.load(std::memory_order_relaxed); }
  /// For the registration: the shape after a step, where wantsShape().
  void show(std::shared_ptr<TriMesh> shape);

 private:
  std::atomic<bool> wants_end_{false}, wants_shape_{false};
  std::mutex mutex_;
  std::shared_ptr<TriMesh> newest_;
};

}  // namespace stipple
