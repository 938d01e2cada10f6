#include "fit/registration/even_sliding.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "mesh/adapt/diffusion.h"
#include "mesh/adapt/moving_samples.h"
#include "mesh/adapt/weighted_diffusion.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1024;
constexpr double kFirstSeconds = 1.0, kMostSeconds = 10.0, kFewestSeconds = 1.0 / 64;
/// Vertices are at rest once none moves by more of the mean edge length in a step.
constexpr double kAtRest = 1e-3;
/// Or once so many steps have made the mesh no more even by that share.
constexpr int kIdleSteps = 16;
constexpr double kIdleGain = 0.01;
/// Evenness may get that much worse in a step: edges become even before areas do.
constexpr double kMostRise = 1.05;
constexpr double kStay = 0.5, kSpread = 0.5;
constexpr int kSmoothings = 3;
constexpr int kTurnBacks = 32;
/// Radians between two faces: below it, what bends is the rounding of float32, as on a plane.
constexpr double kNoBend = 5e-4;

/// Areas and unevenness of one state of a mesh, each area counted in its goal.
struct Evenness {
  std::vector<double> weights;  ///< [n] that draw vertices to where areas are large, mean 1
  double unevenness = 0;        ///< of triangles and edges: standard deviations over the mean
};

/// Standard deviation of the lengths of edges, each counted in its goal, over their mean.
double unevennessOfEdges(const MeshLinks& links, std::span<const Vec3d> places,
                         std::span<const double> goals) {
  double first = 0, second = 0, count = 0;
  for (size_t v = 0; v < places.size(); ++v) {
    for (const uint32_t other : links.neighbours(v)) {
      const double length = 2 * (places[v] - places[other]).norm() / (goals[v] + goals[other]);
      first += length;
      second += length * length;
      count += 1;
    }
  }
  const double mean = first / count;
  return std::sqrt(std::max(0.0, second / count - mean * mean)) / mean;
}

Evenness evennessOf(const MeshLinks& links, std::span<const Vec3d> places,
                    std::span<const double> goals) {
  const std::span<const uint32_t> triangles = links.triangles();
  std::vector<double> areas(links.triangleCount());
  parallelFor(areas.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) {
      areas[t] = 0.5 * areaVector(triangles, places, static_cast<uint32_t>(t)).norm();
    }
  });
  Evenness made;
  made.weights.resize(places.size());
  double sum = 0;
  for (size_t v = 0; v < places.size(); ++v) {
    for (const uint32_t corner : links.corners(v)) made.weights[v] += areas[corner / 3] / 3;
    // At rest w h is even, h the length of edges: so the cube makes h as the goals are.
    made.weights[v] /= goals[v] * goals[v] * goals[v];
    sum += made.weights[v];
  }
  for (double& weight : made.weights) weight *= static_cast<double>(places.size()) / sum;
  double first = 0, second = 0;
  for (size_t t = 0; t < areas.size(); ++t) {
    const double goal =
        (goals[triangles[t * 3]] + goals[triangles[t * 3 + 1]] + goals[triangles[t * 3 + 2]]) / 3;
    const double area = areas[t] / (goal * goal);
    first += area;
    second += area * area;
  }
  const double mean = first / static_cast<double>(areas.size());
  made.unevenness =
      std::sqrt(std::max(0.0, second / static_cast<double>(areas.size()) - mean * mean)) / mean +
      unevennessOfEdges(links, places, goals);
  return made;
}

/// 0..pi; 0 where one of them has no length.
double angleBetween(const Vec3d& a, const Vec3d& b) {
  if (!(a.squaredNorm() > 0 && b.squaredNorm() > 0)) return 0;
  const Vec3d first = a / a.norm(), second = b / b.norm();
  return 2 * std::atan2((first - second).norm(), (first + second).norm());
}

double meanEdge(const MeshLinks& links, std::span<const Vec3d> places) {
  double sum = 0;
  size_t count = 0;
  for (size_t v = 0; v < places.size(); ++v) {
    for (const uint32_t other : links.neighbours(v)) sum += (places[v] - places[other]).norm();
    count += links.neighbours(v).size();
  }
  return sum / static_cast<double>(count);
}

/// Vertices as they slide.
class Slide {
 public:
  Slide(const MeshLinks& links, std::span<const Vec3d> positions, const SlidingSurface& surface,
        std::span<const double> goals)
      : links_(links),
        surface_(surface),
        goals_(goals),
        moves_(movesOf(surface, positions.size())),
        diffusion_(links, moves_),
        given_(positions.begin(), positions.end()),
        rest_(kAtRest * meanEdge(links, positions)) {
    best_ = given_;
    const Evenness evenness = evennessOf(links_, given_, goals_);
    best_unevenness_ = evenness.unevenness;
    given_turned_ = surface_.turned(given_);
    start(1.0);
  }

  /// Everything as given, with lines a share of their way to even ones.
  void start(double share) {
    state_.places = given_;
    surface_.divideLines(state_.places, goals_, share);
    enter(state_);
    seconds_ = kFirstSeconds;
    is_at_rest_ = false;
    idle_steps_ = 0;
    idle_from_ = state_.evenness.unevenness;
    keepBest();
  }

  /// True where it came to something better than the given mesh.
  bool isBetter() const { return is_better_; }
  bool isAtRest() const { return is_at_rest_; }
  std::span<const Vec3d> places() const { return state_.places; }
  std::vector<Vec3d> best() const { return best_; }

  void step() {
    std::vector<Vec3d> pull(given_.size());
    weightedLaplacian(links_, state_.evenness.weights, state_.places, pull);
    for (size_t v = 0; v < pull.size(); ++v) {
      const SurfaceLanding& at = state_.landings[v];
      const Vec3d across = areaVector(at.corners, given_, 0);
      const double squared = across.squaredNorm();
      pull[v] = -pull[v];
      if (squared > 0) pull[v] -= across * (pull[v].dot(across) / squared);
    }
    if (++idle_steps_ > kIdleSteps) is_at_rest_ = true;
    diffusion_.factor(state_.evenness.weights, seconds_);
    diffusion_.solve(pull);
    State next;
    next.places = state_.places;
    for (size_t v = 0; v < pull.size(); ++v) next.places[v] += pull[v];
    enter(next);
    const bool is_worse = next.evenness.unevenness > kMostRise * state_.evenness.unevenness;
    if (is_worse) {
      seconds_ *= 0.5;
      is_at_rest_ |= seconds_ < kFewestSeconds;
      return;
    }
    double most = 0;
    for (size_t v = 0; v < pull.size(); ++v) {
      most = std::max(most, (next.places[v] - state_.places[v]).norm());
    }
    is_at_rest_ |= most < rest_;
    seconds_ = std::min(2 * seconds_, kMostSeconds);
    state_ = std::move(next);
    if (state_.evenness.unevenness < (1 - kIdleGain) * idle_from_) {
      idle_from_ = state_.evenness.unevenness;
      idle_steps_ = 0;
      is_at_rest_ = false;
    }
    keepBest();
  }

 private:
  struct State {
    std::vector<Vec3d> places;
    std::vector<SurfaceLanding> landings;
    Evenness evenness;
  };

  static std::vector<uint8_t> movesOf(const SlidingSurface& surface, size_t count) {
    std::vector<uint8_t> moves(count);
    for (size_t v = 0; v < count; ++v) moves[v] = surface.isFree(v);
    return moves;
  }

  /// Lands the places of a state and looks at it.
  void enter(State& state) const {
    state.landings = surface_.land(state.places);
    std::vector<double> goals(given_.size());
    for (size_t v = 0; v < goals.size(); ++v) goals[v] = state.landings[v].of(goals_);
    state.evenness = evennessOf(links_, state.places, goals);
  }

  /// Brings vertices back to where they are in the best state, around every triangle that is
  /// turned over though it was not in the given mesh, until there is none. False where some stay.
  bool turnBack(std::vector<Vec3d>& places) const {
    const std::span<const uint32_t> triangles = links_.triangles();
    for (int round = 0; round < kTurnBacks; ++round) {
      const std::vector<uint8_t> turned = surface_.turned(places);
      bool is_sound = true;
      for (size_t corner = 0; corner < triangles.size(); ++corner) {
        if (turned[corner / 3] <= given_turned_[corner / 3]) continue;
        places[triangles[corner]] = best_[triangles[corner]];
        is_sound = false;
      }
      if (is_sound) return true;
    }
    return false;
  }

  void keepBest() {
    if (!(state_.evenness.unevenness < best_unevenness_)) return;
    State sound;
    sound.places = state_.places;
    if (!turnBack(sound.places)) return;
    enter(sound);
    if (!(sound.evenness.unevenness < best_unevenness_)) return;
    best_ = std::move(sound.places);
    best_unevenness_ = sound.evenness.unevenness;
    is_better_ = true;
  }

  const MeshLinks& links_;
  const SlidingSurface& surface_;
  std::span<const double> goals_;
  std::vector<uint8_t> moves_;
  WeightedDiffusion diffusion_;
  std::vector<Vec3d> given_, best_;
  double rest_, best_unevenness_ = 0, seconds_ = kFirstSeconds;
  double idle_from_ = 0;
  std::vector<uint8_t> given_turned_;  ///< [F]
  int idle_steps_ = 0;
  State state_;
  bool is_better_ = false, is_at_rest_ = false;
};

}  // namespace

std::vector<double> edgeGoals(const MeshLinks& links, std::span<const Vec3d> positions,
                              const SlidingSurface& surface, MeshDensity density, double shortest) {
  std::vector<double> goals(positions.size(), 1.0);
  if (density != MeshDensity::kAdaptive) return goals;
  const std::span<const uint32_t> triangles = links.triangles();
  std::vector<double> areas(positions.size(), 0.0), bends(positions.size(), 0.0);
  for (uint32_t v = 0; v < positions.size(); ++v) {
    const std::span<const uint32_t> corners = links.corners(v);
    for (const uint32_t corner : corners) {
      areas[v] += areaVector(triangles, positions, corner / 3).norm() / 6;
      const uint32_t next = triangles[corner / 3 * 3 + (corner + 1) % 3];
      if (surface.isSharp(v, next)) continue;
      // The triangle on the other side of the edge from v to next.
      for (const uint32_t other : corners) {
        if (triangles[other / 3 * 3 + (other + 2) % 3] != next) continue;
        const double angle = angleBetween(areaVector(triangles, positions, corner / 3),
                                          areaVector(triangles, positions, other / 3));
        if (angle > kNoBend) bends[v] += 0.5 * angle * (positions[next] - positions[v]).norm();
      }
    }
  }
  double area = 0, mean = 0;
  for (size_t v = 0; v < goals.size(); ++v) {
    bends[v] = areas[v] > 0 ? bends[v] / areas[v] : 0.0;
  }
  const Diffusion smoothing(links, kStay, kSpread);
  for (int i = 0; i < kSmoothings; ++i) smoothing.solve(std::span<double>(bends));
  for (size_t v = 0; v < goals.size(); ++v) {
    area += areas[v];
    mean += areas[v] * bends[v];
  }
  mean /= area;
  if (!(mean > 0)) return goals;
  const double least = std::max(shortest, 1e-3);
  for (size_t v = 0; v < goals.size(); ++v) {
    const double bend = std::max(bends[v] / mean, least * least);
    goals[v] = std::clamp(1 / std::sqrt(bend), least, 1 / least);
  }
  return goals;
}

EvenSliding slideEvenly(
    const MeshLinks& links, std::span<const Vec3d> positions, const SlidingSurface& surface,
    const MeshAdapterOptions& options,
    const std::function<bool(uint32_t step, std::span<const Vec3d> places)>& goes_on) {
  EvenSliding made;
  made.places.assign(positions.begin(), positions.end());
  if (options.density == MeshDensity::kOff) return made;
  const std::vector<double> goals =
      edgeGoals(links, positions, surface, options.density, options.shortest);
  Slide slide(links, positions, surface, goals);
  // Lines that move far can leave the faces beside them turned over: then they move less.
  for (const double share : {1.0, 0.5, 0.25, 0.0}) {
    if (share < 1) slide.start(share);
    for (uint32_t step = 0; step < options.steps && !slide.isAtRest(); ++step) {
      if (!goes_on(made.step_count, slide.places())) {
        made.places = slide.best();
        return made;
      }
      slide.step();
      ++made.step_count;
    }
    if (slide.isBetter() || surface.lineCount() == 0) break;
  }
  made.places = slide.best();
  return made;
}

}  // namespace stipple
