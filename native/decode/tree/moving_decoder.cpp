#include "decode/tree/moving_decoder.h"

#include <algorithm>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "decode/tree/merge_leaves.h"

namespace stipple {

namespace {

/// Rows of a cut that are gathered and moved together: their numbers stay in the cache.
constexpr size_t kPiece = 1024;

/// Rows of inner nodes and leaves by the ids of their tree.
class NodeRows {
 public:
  NodeRows(const MotionCloud& inner, const MotionCloud& leaves, std::span<const uint32_t> ids)
      : inner_(inner), leaves_(leaves), ids_(ids) {}

  size_t size() const { return ids_.size(); }

  /// Out: rows [size(), stride] of the column that `column` picks of a cloud.
  template <typename Column>
  void take(const Column& column, size_t stride, float* rows) const {
    const float* inner = column(inner_).data();
    const float* leaves = column(leaves_).data();
    const size_t inner_count = inner_.size();
    for (size_t i = 0; i < ids_.size(); ++i) {
      const size_t id = ids_[i];
      const float* row =
          id < inner_count ? inner + id * stride : leaves + (id - inner_count) * stride;
      std::copy_n(row, stride, rows + i * stride);
    }
  }

 private:
  const MotionCloud& inner_;
  const MotionCloud& leaves_;
  std::span<const uint32_t> ids_;
};

/// Columns of a piece of moving splats.
struct PieceColumns {
  static constexpr size_t kWidth = 3 + 4 + 1 + 3 * kMotionWaves + 4 + 4 + 2 + 1;
  std::vector<float> numbers = std::vector<float>(kWidth * kPiece);

  MotionColumns<const float> take(const NodeRows& rows) {
    float* next = numbers.data();
    const auto taken = [&](const auto& column, size_t stride) {
      float* place = next;
      next += stride * kPiece;
      rows.take(column, stride, place);
      return place;
    };
    MotionColumns<const float> columns;
    columns.positions = taken(
        [](const auto& c) -> auto& { return c.splats.positions; }, 3);
    columns.rotations = taken(
        [](const auto& c) -> auto& { return c.splats.rotations; }, 4);
    columns.opacities = taken(
        [](const auto& c) -> auto& { return c.splats.opacities; }, 1);
    for (size_t wave = 0; wave < kMotionWaves; ++wave) {
      columns.waves[wave] = taken(
          [wave](const auto& c) -> auto& { return c.waves[wave]; }, 3);
    }
    columns.phases = taken(
        [](const auto& c) -> auto& { return c.phases; }, 4);
    columns.spins = taken(
        [](const auto& c) -> auto& { return c.spins; }, 4);
    columns.lifespans = taken(
        [](const auto& c) -> auto& { return c.lifespans; }, 2);
    columns.centres = taken(
        [](const auto& c) -> auto& { return c.centres; }, 1);
    return columns;
  }
};

}  // namespace

MovingTree MovingTreeSource::treeOf(const MotionCloud& moving, Progress* progress) const {
  return build ? build(moving, progress) : buildMovingTree(moving, {}, {}, progress);
}

uint64_t MovingTreeSource::memoryBoundOf(const MotionCloud& moving) const {
  return memory_bound ? memory_bound(moving)
                      : movingTreeMemoryBound(moving.size(), moving.splats.sh_degree);
}

MovingDecoder::MovingDecoder(MotionCloud leaves, std::shared_ptr<const MovingTree> tree,
                             MovingTreeSource trees)
    : leaves_(std::move(leaves)), trees_(std::move(trees)), tree_(std::move(tree)) {
  if (tree_) validateTree(*tree_, leaves_, "tree of moving splats");
}

std::shared_ptr<const MovingTree> MovingDecoder::tree() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return tree_;
}

std::shared_ptr<const MovingTree> MovingDecoder::builtTree(Progress* progress) const {
  if (auto known = tree()) return known;
  std::lock_guard<std::mutex> lock(building_);
  if (auto known = tree()) return known;
  auto made = std::make_shared<const MovingTree>(trees_.treeOf(leaves_, progress));
  std::lock_guard<std::mutex> told(mutex_);
  tree_ = made;
  return made;
}

std::vector<uint32_t> MovingDecoder::cut(uint64_t budget, Progress* progress) const {
  return cutOfShape(*builtTree(progress), budget);
}

SplatCloud MovingDecoder::decode(const DecodeRequest& request) const {
  if (request.gaussians_per_anchor != 1) {
    fail(ErrorCode::kInvalidArgument, "gaussians_per_anchor is " +
                                          std::to_string(request.gaussians_per_anchor) +
                                          "; 1 is allowed for splats that exist already");
  }
  if (request.budget == leaves_.size()) return splatsAt(leaves_, request.time);
  const std::shared_ptr<const MovingTree> tree = builtTree(request.progress);
  const std::vector<uint32_t> ids = cutOfShape(*tree, request.budget);
  const MotionKernel kernel = chosenMotionKernel();
  const TimeWindow window = leaves_.clip.window();
  const auto time = static_cast<float>(leaves_.clip.partOf(request.time));
  SplatCloud out = emptyLike(leaves_.splats, ids.size());
  const size_t sh_stride = out.shStride();
  parallelFor(ids.size(), kPiece, [&](size_t first, size_t last) {
    PieceColumns piece;
    for (size_t begin = first; begin < last; begin += kPiece) {
      const size_t count = std::min(kPiece, last - begin);
      const NodeRows rows(tree->nodes, leaves_, {ids.data() + begin, count});
      kernel.moments(piece.take(rows), window, time, 0, count,
                     {&out.positions[3 * begin], &out.rotations[4 * begin], &out.opacities[begin]});
      rows.take(
          [](const auto& c) -> auto& { return c.splats.scales; }, 3, &out.scales[3 * begin]);
      rows.take(
          [](const auto& c) -> auto& { return c.splats.sh; }, sh_stride,
          &out.sh[sh_stride * begin]);
    }
  });
  return out;
}

uint64_t MovingDecoder::memoryBound(uint64_t budget, uint32_t) const {
  constexpr uint64_t kOthers = 3 + 4 + 3 + 1;
  // What allocators round up, and pieces of several threads.
  constexpr uint64_t kRounding = uint64_t{64} << 10;
  constexpr uint64_t kPieces = uint64_t{16} << 20;
  const uint64_t splats =
      budget * (kOthers + leaves_.splats.shStride()) * sizeof(float) + kRounding;
  if (budget >= leaves_.size()) return splats;
  const uint64_t cut = splats + budget * sizeof(uint32_t) + kPieces;
  return tree() ? cut : cut + trees_.memoryBoundOf(leaves_);
}

}  // namespace stipple
