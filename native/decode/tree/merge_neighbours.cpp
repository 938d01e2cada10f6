#include "decode/tree/merge_neighbours.h"

#include <algorithm>
#include <nanoflann.hpp>

#include "base/parallel.h"

namespace stipple {

namespace {

/// The view of the places that nanoflann wants.
struct PlaceList {
  std::span<const float> places;
  size_t width;

  size_t kdtree_get_point_count() const { return places.size() / width; }
  float kdtree_get_pt(size_t index, size_t axis) const { return places[index * width + axis]; }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

constexpr double kFarthest = 1e15;
constexpr size_t kPlacesPerLeaf = 16;
constexpr size_t kGrain = 1024;

/// kWidth: numbers of a place; -1: as many as the list says.
template <int kWidth>
std::vector<uint32_t> search(const PlaceList& list, size_t neighbour_count) {
  using PlaceTree =
      nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PlaceList>, PlaceList,
                                          kWidth, uint32_t>;
  const size_t count = list.kdtree_get_point_count();
  std::vector<uint32_t> rows(count * neighbour_count, kNoPlace);
  PlaceTree tree(static_cast<int>(list.width), list,
                 nanoflann::KDTreeSingleIndexAdaptorParams(kPlacesPerLeaf));
  tree.buildIndex();
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    // One more than wanted: the place finds itself, unless it has as many twins.
    std::vector<uint32_t> found(neighbour_count + 1);
    std::vector<float> squared(neighbour_count + 1);
    for (size_t i = begin; i < end; ++i) {
      const size_t found_count = tree.knnSearch(&list.places[i * list.width], neighbour_count + 1,
                                                found.data(), squared.data());
      size_t kept = 0;
      for (size_t k = 0; k < found_count && kept < neighbour_count; ++k) {
        if (found[k] != i) rows[i * neighbour_count + kept++] = found[k];
      }
    }
  });
  return rows;
}

}  // namespace

std::vector<uint32_t> nearestNeighbours(std::span<const double> places, size_t neighbour_count,
                                        size_t width) {
  const size_t count = places.size() / width;
  if (count < 2) return std::vector<uint32_t>(count * neighbour_count, kNoPlace);
  // Distances as float32: neighbours that it cannot tell apart serve alike. Their squares stay in
  // range.
  std::vector<float> rounded(places.size());
  for (size_t i = 0; i < rounded.size(); ++i) {
    rounded[i] = static_cast<float>(std::clamp(places[i], -kFarthest, kFarthest));
  }
  const PlaceList list{rounded, width};
  return width == 3 ? search<3>(list, neighbour_count) : search<-1>(list, neighbour_count);
}

}  // namespace stipple
