#include "decode/tree/merge_neighbours.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <memory>
#include <nanoflann.hpp>

#include "base/fresh_memory.h"
#include "base/parallel.h"
#include "base/random.h"
#include "mesh/cell_table.h"

namespace stipple {

namespace {

/// The view of the places that nanoflann wants. kWidth: numbers of a place; -1: as many as the list
/// says.
template <int kWidth>
struct PlaceList {
  std::span<const float> places;
  size_t list_width;

  size_t width() const { return kWidth > 0 ? static_cast<size_t>(kWidth) : list_width; }
  size_t size() const { return places.size() / width(); }
  const float* place(size_t index) const { return &places[index * width()]; }
  PlaceList part(size_t begin, size_t end) const {
    return {places.subspan(begin * width(), (end - begin) * width()), list_width};
  }
  size_t kdtree_get_point_count() const { return size(); }
  float kdtree_get_pt(size_t index, size_t axis) const { return place(index)[axis]; }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

constexpr double kFarthest = 1e15;
constexpr size_t kPlacesPerLeaf = 16;
constexpr size_t kGrain = 1024;
/// Places are searched in this many trees, of so many places at least.
constexpr size_t kMostParts = 4;
constexpr size_t kLeastPart = 8192;

/// Places that many share. A search would pass over all of them for each, and find the same few.
struct SharedPlaces {
  std::vector<uint32_t> order;   ///< rows, those of one place side by side
  std::vector<uint32_t> begins;  ///< of groups of more than `most`, and their ends
  std::vector<uint32_t> ends;
  std::vector<uint32_t> single;  ///< [..] rows that are searched: all others, and the first of each
};

SharedPlaces sharedPlaces(std::span<const float> places, size_t width, size_t most) {
  const size_t count = places.size() / width;
  std::vector<uint64_t> hashes(count);
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      uint64_t hash = 0;
      for (size_t axis = 0; axis < width; ++axis) {
        // -0 is 0.
        hash = mixBits(hash + std::bit_cast<uint32_t>(places[i * width + axis] + 0.0f));
      }
      hashes[i] = hash >> 32;
    }
  });
  SharedPlaces shared;
  shared.order = sortedOrder(hashes, 32);
  const auto isSame = [&](uint32_t a, uint32_t b) {
    return std::equal(&places[a * width], &places[a * width] + width, &places[b * width]);
  };
  std::vector<uint8_t> is_left(count, 1);
  for (size_t begin = 0; begin < count;) {
    const uint32_t first = shared.order[begin];
    size_t end = begin + 1;
    while (end < count && isSame(first, shared.order[end])) ++end;
    if (end - begin > most) {
      shared.begins.push_back(static_cast<uint32_t>(begin));
      shared.ends.push_back(static_cast<uint32_t>(end));
      for (size_t i = begin + 1; i < end; ++i) is_left[shared.order[i]] = 0;
    }
    begin = end;
  }
  for (uint32_t i = 0; i < count; ++i) {
    if (is_left[i]) shared.single.push_back(i);
  }
  return shared;
}

/// Of a place that many share each has those before and after it, in a ring; the first one has half
/// of them, and others of other places beside.
void fillRings(const SharedPlaces& shared, size_t neighbour_count, std::vector<uint32_t>& rows) {
  for (size_t group = 0; group < shared.begins.size(); ++group) {
    const uint32_t* members = &shared.order[shared.begins[group]];
    const size_t size = shared.ends[group] - shared.begins[group];
    parallelFor(size, kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        uint32_t* row = &rows[members[i] * neighbour_count];
        const size_t count = i == 0 ? (neighbour_count + 1) / 2 : neighbour_count;
        for (size_t k = 0; k < count; ++k) {
          const size_t step = k / 2 + 1;
          row[k] = members[(k % 2 == 0 ? i + step : i + size - step) % size];
        }
      }
    });
  }
}

/// The nearest that some trees, one after another, have found; as nanoflann wants it.
class Nearest {
 public:
  explicit Nearest(size_t capacity) : rows_(capacity), squared_(capacity) {}

  void begin() {
    count_ = 0;
    squared_.back() = std::numeric_limits<float>::max();
  }
  /// Of the places of one tree: what is added to their numbers.
  void setFirst(size_t first) { first_ = static_cast<uint32_t>(first); }

  float worstDist() const { return squared_.back(); }
  size_t size() const { return count_; }
  bool full() const { return count_ == rows_.size(); }
  uint32_t row(size_t k) const { return rows_[k]; }

  bool addPoint(float squared, uint32_t index) {
    // A leaf asks for the worst once, before its first place.
    if (full() && !(squared < worstDist())) return true;
    size_t at = std::min(count_, rows_.size() - 1);
    if (count_ < rows_.size()) ++count_;
    for (; at > 0 && squared_[at - 1] > squared; --at) {
      squared_[at] = squared_[at - 1];
      rows_[at] = rows_[at - 1];
    }
    squared_[at] = squared;
    rows_[at] = first_ + index;
    return true;
  }

 private:
  std::vector<uint32_t> rows_;
  std::vector<float> squared_;
  size_t count_ = 0;
  uint32_t first_ = 0;
};

/// A tree over some of the places, and the box around them.
template <int kWidth>
class PlaceTree {
 public:
  PlaceTree(const PlaceList<kWidth>& all, size_t begin, size_t end)
      : list_(all.part(begin, end)),
        first_(begin),
        low_(all.width(), std::numeric_limits<float>::max()),
        high_(all.width(), std::numeric_limits<float>::lowest()),
        tree_(static_cast<int>(all.width()), list_,
              nanoflann::KDTreeSingleIndexAdaptorParams(kPlacesPerLeaf)) {
    tree_.buildIndex();
    for (size_t i = 0; i < list_.size(); ++i) {
      const float* place = list_.place(i);
      for (size_t axis = 0; axis < all.width(); ++axis) {
        low_[axis] = std::min(low_[axis], place[axis]);
        high_[axis] = std::max(high_[axis], place[axis]);
      }
    }
  }

  /// Adds what is nearer than the worst of those found.
  void search(const float* place, Nearest& nearest) const {
    float squared = 0;
    for (size_t axis = 0; axis < low_.size(); ++axis) {
      const float beyond = std::max({low_[axis] - place[axis], place[axis] - high_[axis], 0.0f});
      squared += beyond * beyond;
    }
    if (!(squared < nearest.worstDist())) return;
    nearest.setFirst(first_);
    tree_.findNeighbors(nearest, place, nanoflann::SearchParams());
  }

 private:
  using List = PlaceList<kWidth>;
  using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, List>, List,
                                                   kWidth, uint32_t>;
  List list_;
  size_t first_;
  std::vector<float> low_, high_;
  Tree tree_;
};

/// Finds the neighbours of some places among each other; `searched` has the numbers of those.
template <int kWidth>
void search(std::span<const float> places, size_t width, std::span<const uint32_t> searched,
            size_t neighbour_count, std::vector<uint32_t>& rows) {
  const size_t count = searched.size();
  if (count < 2) return;
  std::vector<float> side_by_side;
  if (count * width < places.size()) {
    resizeFresh(side_by_side, count * width);
    for (size_t i = 0; i < count; ++i) {
      std::copy_n(&places[searched[i] * width], width, &side_by_side[i * width]);
    }
    places = side_by_side;
  }
  const PlaceList<kWidth> list{places, width};
  // The library builds a tree on one thread. Rows follow each other in space, so parts of them
  // hardly overlap.
  const size_t part_size = std::max<size_t>(kLeastPart, (count + kMostParts - 1) / kMostParts);
  std::vector<std::unique_ptr<PlaceTree<kWidth>>> trees(rangeCount(count, part_size));
  parallelFor(count, part_size, [&](size_t begin, size_t end) {
    trees[begin / part_size] = std::make_unique<PlaceTree<kWidth>>(list, begin, end);
  });
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    // One more than wanted: the place finds itself, unless it has as many twins.
    Nearest nearest(neighbour_count + 1);
    for (size_t i = begin; i < end; ++i) {
      const float* place = list.place(i);
      const size_t own = i / part_size;
      nearest.begin();
      trees[own]->search(place, nearest);
      for (size_t part = 0; part < trees.size(); ++part) {
        if (part != own) trees[part]->search(place, nearest);
      }
      uint32_t* row = &rows[searched[i] * neighbour_count];
      // What stands in the row already is of the same place.
      size_t kept = static_cast<size_t>(std::find(row, row + neighbour_count, kNoPlace) - row);
      for (size_t k = 0; k < nearest.size() && kept < neighbour_count; ++k) {
        if (nearest.row(k) != i) row[kept++] = searched[nearest.row(k)];
      }
    }
  });
}

}  // namespace

std::vector<uint32_t> nearestNeighbours(std::span<const double> places, size_t neighbour_count,
                                        size_t width) {
  const size_t count = places.size() / width;
  std::vector<uint32_t> rows(count * neighbour_count, kNoPlace);
  if (count < 2) return rows;
  // Distances as float32: neighbours that it cannot tell apart serve alike. Their squares stay in
  // range.
  std::vector<float> rounded;
  resizeFresh(rounded, places.size());
  parallelFor(rounded.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      rounded[i] = static_cast<float>(std::clamp(places[i], -kFarthest, kFarthest));
    }
  });
  const SharedPlaces shared = sharedPlaces(rounded, width, 2 * neighbour_count);
  fillRings(shared, neighbour_count, rows);
  if (width == 3) {
    search<3>(rounded, width, shared.single, neighbour_count, rows);
  } else {
    search<-1>(rounded, width, shared.single, neighbour_count, rows);
  }
  return rows;
}

}  // namespace stipple
