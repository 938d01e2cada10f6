#include "decode/tree/merge_neighbours.h"

#include <algorithm>
#include <bit>
#include <nanoflann.hpp>

#include "base/parallel.h"
#include "base/random.h"
#include "mesh/cell_table.h"

namespace stipple {

namespace {

/// The view of the places that nanoflann wants.
struct PlaceList {
  std::span<const float> places;
  size_t width;
  std::span<const uint32_t> rows;  ///< those that are searched

  const float* place(size_t index) const { return &places[rows[index] * width]; }
  size_t kdtree_get_point_count() const { return rows.size(); }
  float kdtree_get_pt(size_t index, size_t axis) const { return place(index)[axis]; }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

constexpr double kFarthest = 1e15;
constexpr size_t kPlacesPerLeaf = 16;
constexpr size_t kGrain = 1024;

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

/// kWidth: numbers of a place; -1: as many as the list says.
template <int kWidth>
void search(const PlaceList& list, size_t neighbour_count, std::vector<uint32_t>& rows) {
  using PlaceTree =
      nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PlaceList>, PlaceList,
                                          kWidth, uint32_t>;
  const size_t count = list.rows.size();
  if (count < 2) return;
  PlaceTree tree(static_cast<int>(list.width), list,
                 nanoflann::KDTreeSingleIndexAdaptorParams(kPlacesPerLeaf));
  tree.buildIndex();
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    // One more than wanted: the place finds itself, unless it has as many twins.
    std::vector<uint32_t> found(neighbour_count + 1);
    std::vector<float> squared(neighbour_count + 1);
    for (size_t i = begin; i < end; ++i) {
      const size_t found_count =
          tree.knnSearch(list.place(i), neighbour_count + 1, found.data(), squared.data());
      uint32_t* row = &rows[list.rows[i] * neighbour_count];
      // What stands in the row already is of the same place.
      size_t kept = static_cast<size_t>(std::find(row, row + neighbour_count, kNoPlace) - row);
      for (size_t k = 0; k < found_count && kept < neighbour_count; ++k) {
        if (found[k] != i) row[kept++] = list.rows[found[k]];
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
  std::vector<float> rounded(places.size());
  for (size_t i = 0; i < rounded.size(); ++i) {
    rounded[i] = static_cast<float>(std::clamp(places[i], -kFarthest, kFarthest));
  }
  const SharedPlaces shared = sharedPlaces(rounded, width, 2 * neighbour_count);
  fillRings(shared, neighbour_count, rows);
  const PlaceList list{rounded, width, shared.single};
  if (width == 3) {
    search<3>(list, neighbour_count, rows);
  } else {
    search<-1>(list, neighbour_count, rows);
  }
  return rows;
}

}  // namespace stipple
