#include "mesh/adapt/mesh_links.h"

#include <algorithm>

namespace stipple {

MeshLinks::MeshLinks(size_t vertex_count, std::span<const uint32_t> triangles)
    : triangles_(triangles.begin(), triangles.end()),
      corner_begins_(vertex_count + 1, 0),
      neighbour_begins_(vertex_count + 1, 0),
      corners_(triangles.size()),
      is_border_(vertex_count, 0) {
  for (const uint32_t vertex : triangles_) ++corner_begins_[vertex + 1];
  for (size_t v = 0; v < vertex_count; ++v) corner_begins_[v + 1] += corner_begins_[v];
  std::vector<size_t> next(corner_begins_.begin(), corner_begins_.end() - 1);
  for (size_t corner = 0; corner < triangles_.size(); ++corner) {
    corners_[next[triangles_[corner]]++] = static_cast<uint32_t>(corner);
  }
  std::vector<uint32_t> ends;
  for (size_t v = 0; v < vertex_count; ++v) {
    ends.clear();
    for (const uint32_t corner : this->corners(v)) {
      const size_t first = corner / 3 * 3;
      ends.push_back(triangles_[first + (corner + 1) % 3]);
      ends.push_back(triangles_[first + (corner + 2) % 3]);
    }
    std::sort(ends.begin(), ends.end());
    for (size_t i = 0; i < ends.size();) {
      size_t past = i;
      while (past < ends.size() && ends[past] == ends[i]) ++past;
      if (past - i != 2) is_border_[v] = 1;
      neighbours_.push_back(ends[i]);
      i = past;
    }
    neighbour_begins_[v + 1] = neighbours_.size();
  }
}

}  // namespace stipple
