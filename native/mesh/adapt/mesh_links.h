#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// What hangs together with what in a mesh whose faces stay: made once, read in every step.
class MeshLinks {
 public:
  /// In: triangles [F,3] of three different indices below vertex_count. They are copied.
  MeshLinks(size_t vertex_count, std::span<const uint32_t> triangles);

  size_t vertexCount() const { return is_border_.size(); }
  size_t triangleCount() const { return triangles_.size() / 3; }
  std::span<const uint32_t> triangles() const { return triangles_; }
  /// Corners of triangles (indices into triangles()) that lie at a vertex, ascending.
  std::span<const uint32_t> corners(size_t vertex) const {
    return {corners_.data() + corner_begins_[vertex],
            corner_begins_[vertex + 1] - corner_begins_[vertex]};
  }
  /// Vertices at the other end of each edge, each once, ascending.
  std::span<const uint32_t> neighbours(size_t vertex) const {
    return {neighbours_.data() + neighbour_begins_[vertex],
            neighbour_begins_[vertex + 1] - neighbour_begins_[vertex]};
  }
  /// True at the ends of edges that do not have exactly two triangles: all boundary loops, and
  /// edges where three sheets or more meet.
  bool isBorder(size_t vertex) const { return is_border_[vertex] != 0; }

 private:
  std::vector<uint32_t> triangles_;
  std::vector<size_t> corner_begins_, neighbour_begins_;
  std::vector<uint32_t> corners_, neighbours_;
  std::vector<uint8_t> is_border_;
};

}  // namespace stipple
