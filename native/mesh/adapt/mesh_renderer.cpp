#include "mesh/adapt/mesh_renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "math/affine.h"
#include "math/cross_product.h"

namespace stipple {

namespace {

/// Triangles that a way between two centres is followed across: more lie in it only where they are
/// far smaller than pixels.
constexpr int kMostSteps = 64;

std::vector<uint32_t> trianglesAcross(std::span<const uint32_t> triangles) {
  struct Side {
    std::pair<uint32_t, uint32_t> ends;
    uint32_t corner;  ///< index into triangles of the one opposite
  };
  std::vector<Side> sides(triangles.size());
  for (uint32_t c = 0; c < triangles.size(); ++c) {
    const uint32_t first = c / 3 * 3;
    sides[c] = {std::minmax(triangles[first + (c + 1) % 3], triangles[first + (c + 2) % 3]), c};
  }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return a.ends != b.ends ? a.ends < b.ends : a.corner < b.corner;
  });
  std::vector<uint32_t> across(triangles.size(), MeshView::kNoTriangle);
  for (size_t i = 0; i < sides.size();) {
    size_t end = i;
    while (end < sides.size() && sides[end].ends == sides[i].ends) ++end;
    if (end - i == 2) {
      across[sides[i].corner] = sides[i + 1].corner / 3;
      across[sides[i + 1].corner] = sides[i].corner / 3;
    }
    i = end;
  }
  return across;
}

/// What the edge functions of FlatTriangle take.
Vec3d rayOf(const Camera& camera, uint32_t x, uint32_t y) {
  return {(x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy, 1.0};
}

Vec3d rayOf(const Camera& camera, uint32_t pixel) {
  return rayOf(camera, pixel % camera.width, pixel / camera.width);
}

/// The functions of a triangle's edges, over their determinant: barycentric but for their sum.
Vec3d edgesAt(const FlatTriangle& flat, const Vec3d& ray) {
  return Vec3d(flat.edges[0].dot(ray), flat.edges[1].dot(ray), flat.edges[2].dot(ray)) /
         flat.determinant;
}

std::vector<Vec3d> placed(const Camera& camera, std::span<const Vec3d> positions) {
  const Mat3d linear = linearPart(camera.world_to_camera);
  const Vec3d translation = translationPart(camera.world_to_camera);
  std::vector<Vec3d> made(positions.size());
  for (size_t v = 0; v < made.size(); ++v) made[v] = linear * positions[v] + translation;
  return made;
}

/// Derivatives by the corners of a triangle in the camera's frame.
using CornerGradients = std::array<Vec3d, 3>;

/// edgesAt(ray) is M^-1 ray with the corners as columns of M, so that its derivative is
/// -M^-1 dM edgesAt(ray). Adds those of by_edges . edgesAt(ray).
void addEdges(const FlatTriangle& flat, const Vec3d& edges, const Vec3d& by_edges,
              CornerGradients& by_corners) {
  const Vec3d back =
      (by_edges[0] * flat.edges[0] + by_edges[1] * flat.edges[1] + by_edges[2] * flat.edges[2]) /
      flat.determinant;
  for (size_t i = 0; i < 3; ++i) by_corners[i] -= edges[static_cast<Eigen::Index>(i)] * back;
}

/// Makes a view empty: all of it where it is another camera's, else what it shows.
void clear(const Camera& camera, MeshView& view) {
  view.outlines.clear();
  if (view.width != camera.width || view.height != camera.height) {
    view.width = camera.width;
    view.height = camera.height;
    view.box = {0, camera.width, 0, camera.height};
    const size_t pixel_count = size_t{camera.width} * camera.height;
    view.plain.resize(pixel_count * 4);
    view.pixels.resize(pixel_count * 4);
    view.depths.resize(pixel_count);
    view.triangles.resize(pixel_count);
  }
  view.forEachRow([&](size_t begin, size_t end) {
    std::fill_n(&view.plain[begin * 4], (end - begin) * 4, 0.0);
    std::fill_n(&view.pixels[begin * 4], (end - begin) * 4, 0.0);
    std::fill_n(&view.depths[begin], end - begin, std::numeric_limits<double>::infinity());
    std::fill_n(&view.triangles[begin], end - begin, MeshView::kNoTriangle);
  });
}

}  // namespace

MeshRenderer::MeshRenderer(std::span<const uint32_t> triangles)
    : triangles_(triangles.begin(), triangles.end()), across_(trianglesAcross(triangles)) {}

Vec3d MeshRenderer::weightsAt(const MeshView& view, const Camera& camera, uint32_t pixel) {
  const Vec3d edges = edgesAt(view.flat[view.triangles[pixel]], rayOf(camera, pixel));
  return edges / edges.sum();
}

MeshView MeshRenderer::draw(const Camera& camera, std::span<const Vec3d> positions,
                            std::span<const Vec3d> colours) const {
  MeshView view;
  draw(camera, positions, colours, view);
  return view;
}

void MeshRenderer::draw(const Camera& camera, std::span<const Vec3d> positions,
                        std::span<const Vec3d> colours, MeshView& view) const {
  requireImagePlane(camera, "the drawing of a mesh");
  clear(camera, view);
  drawPlain(camera, placed(camera, positions), colours, view);
  view.forEachRow([&](size_t begin, size_t end) {
    std::copy(view.plain.begin() + static_cast<std::ptrdiff_t>(begin * 4),
              view.plain.begin() + static_cast<std::ptrdiff_t>(end * 4),
              view.pixels.begin() + static_cast<std::ptrdiff_t>(begin * 4));
  });
  for (const OutlineCrossing& crossing : view.outlines) {
    const bool is_inside = crossing.along < 0.5;
    const size_t changed = is_inside ? crossing.inside : crossing.outside;
    const size_t other = is_inside ? crossing.outside : crossing.inside;
    const double share = is_inside ? 0.5 - crossing.along : crossing.along - 0.5;
    for (size_t c = 0; c < 4; ++c) {
      view.pixels[changed * 4 + c] +=
          share * (view.plain[other * 4 + c] - view.plain[changed * 4 + c]);
    }
  }
}

void MeshRenderer::drawPlain(const Camera& camera, std::span<const Vec3d> vertices,
                             std::span<const Vec3d> colours, MeshView& view) const {
  const size_t count = triangles_.size() / 3;
  view.flat.resize(count);
  view.faces_camera.assign(count, 0);
  const TriangleRaster raster(camera);
  TriangleRaster::Box all{camera.width, 0, camera.height, 0};
  for (uint32_t t = 0; t < count; ++t) {
    const uint32_t* v = &triangles_[size_t{t} * 3];
    const Vec3d corners[3] = {vertices[v[0]], vertices[v[1]], vertices[v[2]]};
    if (!raster.flatten(corners, view.flat[t])) continue;
    // flatten() turns the functions of triangles that look away.
    Vec3d second = corners[1], third = corners[2];
    if (camera.model == CameraModel::kOrthographic) second.z() = third.z() = 1;
    view.faces_camera[t] = crossProduct(second, third).dot(view.flat[t].edges[0]) > 0;
    TriangleRaster::Box box;
    if (!raster.boxOf(corners, box)) continue;
    all = {std::min(all.x0, box.x0), std::max(all.x1, box.x1), std::min(all.y0, box.y0),
           std::max(all.y1, box.y1)};
    raster.draw(view.flat[t], box, [&](uint32_t x, uint32_t y, double z, const Vec3d& weights) {
      const size_t pixel = size_t{y} * camera.width + x;
      if (z >= view.depths[pixel]) return;
      view.depths[pixel] = z;
      view.triangles[pixel] = t;
      const Vec3d colour =
          weights[0] * colours[v[0]] + weights[1] * colours[v[1]] + weights[2] * colours[v[2]];
      for (size_t c = 0; c < 3; ++c) view.plain[pixel * 4 + c] = colour[static_cast<int>(c)];
      view.plain[pixel * 4 + 3] = 1.0;
    });
  }
  // Boxes of triangles have the pixel more that outlines need.
  view.box = all.x0 < all.x1 && all.y0 < all.y1 ? all : TriangleRaster::Box{};
  findOutlines(camera, view);
}

void MeshRenderer::findOutlines(const Camera& camera, MeshView& view) const {
  const std::vector<double>& depths = view.depths;
  const auto between = [&](uint32_t a, uint32_t b, bool is_row) {
    const uint32_t ta = view.triangles[a], tb = view.triangles[b];
    if (ta == tb) return;
    const Vec3d ray_a = rayOf(camera, a), ray_b = rayOf(camera, b);
    OutlineCrossing found;
    const auto from = [&](uint32_t first, uint32_t second, const Vec3d& at, const Vec3d& to) {
      const uint32_t triangle = view.triangles[first];
      if (triangle == MeshView::kNoTriangle) return false;
      if (!outlineFrom(view, at, to, triangle, found)) return false;
      // Steep outlines are mixed by their places in rows, others by those in columns: each once.
      const Vec3d& edge = view.flat[found.triangle].edges[found.corner];
      const bool is_steep = std::abs(edge.x() / camera.fx) >= std::abs(edge.y() / camera.fy);
      if (is_steep != is_row) return true;
      found.inside = first;
      found.outside = second;
      view.outlines.push_back(found);
      return true;
    };
    // The sheet in front ends; or one that lies in front of what it goes on as begins.
    if (depths[a] <= depths[b]) {
      if (!from(a, b, ray_a, ray_b)) from(b, a, ray_b, ray_a);
    } else {
      if (!from(b, a, ray_b, ray_a)) from(a, b, ray_a, ray_b);
    }
  };
  for (uint32_t y = view.box.y0; y < view.box.y1; ++y) {
    for (uint32_t x = view.box.x0; x < view.box.x1; ++x) {
      const uint32_t pixel = y * camera.width + x;
      if (x + 1 < view.box.x1) between(pixel, pixel + 1, true);
      if (y + 1 < view.box.y1) between(pixel, pixel + camera.width, false);
    }
  }
}

bool MeshRenderer::outlineFrom(const MeshView& view, const Vec3d& from, const Vec3d& to,
                               uint32_t triangle, OutlineCrossing& found) const {
  const uint8_t facing = view.faces_camera[triangle];
  uint32_t came_from = MeshView::kNoTriangle;
  for (int step = 0; step < kMostSteps; ++step) {
    const FlatTriangle& flat = view.flat[triangle];
    const Vec3d at_first = edgesAt(flat, from), at_last = edgesAt(flat, to);
    double along = 2;
    uint32_t corner = 0;
    for (uint32_t k = 0; k < 3; ++k) {
      const double first = at_first[k], last = at_last[k];
      if (!(last < 0) || !(last < first)) continue;  // the way does not leave by this edge
      const uint32_t behind = across_[size_t{triangle} * 3 + k];
      if (behind != MeshView::kNoTriangle && behind == came_from) continue;
      const double crossing = std::clamp(first / (first - last), 0.0, 1.0);
      if (crossing < along) {
        along = crossing;
        corner = k;
      }
    }
    if (along > 1) return false;  // the sheet goes on to the other centre
    const uint32_t next = across_[size_t{triangle} * 3 + corner];
    if (next == MeshView::kNoTriangle || view.faces_camera[next] != facing ||
        !(view.flat[next].determinant > 0)) {
      found.triangle = triangle;
      found.corner = corner;
      found.along = along;
      return true;
    }
    came_from = triangle;
    triangle = next;
  }
  return false;
}

void MeshRenderer::addGradient(const MeshView& view, const Camera& camera,
                               std::span<const Vec3d> colours, std::span<double> by_pixel,
                               double outline_weight, std::span<Vec3d> by_position,
                               std::span<Vec3d> by_colour) const {
  const Mat3d to_world = linearPart(camera.world_to_camera).transpose();
  const bool is_perspective = camera.model == CameraModel::kPerspective;
  const auto addCorners = [&](uint32_t triangle, const CornerGradients& by_corners) {
    for (size_t i = 0; i < 3; ++i) {
      Vec3d by_corner = by_corners[i];
      if (!is_perspective) by_corner.z() = 0;  // rays are parallel: depth shows nowhere
      by_position[triangles_[size_t{triangle} * 3 + i]] += to_world * by_corner;
    }
  };
  // What the pixels that outlines change have before any of them passes a part on.
  std::vector<Vec4d> by_changed(view.outlines.size());
  for (size_t i = 0; i < view.outlines.size(); ++i) {
    const OutlineCrossing& crossing = view.outlines[i];
    const size_t changed = crossing.along < 0.5 ? crossing.inside : crossing.outside;
    for (size_t c = 0; c < 4; ++c) {
      by_changed[i][static_cast<Eigen::Index>(c)] = by_pixel[changed * 4 + c];
    }
  }
  for (size_t i = 0; i < view.outlines.size(); ++i) {
    const OutlineCrossing& crossing = view.outlines[i];
    const bool is_inside = crossing.along < 0.5;
    const size_t changed = is_inside ? crossing.inside : crossing.outside;
    const size_t other = is_inside ? crossing.outside : crossing.inside;
    const double share = is_inside ? 0.5 - crossing.along : crossing.along - 0.5;
    double by_share = 0;
    for (size_t c = 0; c < 4; ++c) {
      const double by = by_changed[i][static_cast<Eigen::Index>(c)];
      by_share += by * (view.plain[other * 4 + c] - view.plain[changed * 4 + c]);
      by_pixel[other * 4 + c] += share * by;
      by_pixel[changed * 4 + c] -= share * by;
    }
    const FlatTriangle& flat = view.flat[crossing.triangle];
    const Vec3d first = edgesAt(flat, rayOf(camera, crossing.inside));
    const Vec3d last = edgesAt(flat, rayOf(camera, crossing.outside));
    const auto k = static_cast<Eigen::Index>(crossing.corner);
    const double across = first[k] - last[k];
    if (!(across > 0)) continue;
    const double by_along = outline_weight * (is_inside ? -by_share : by_share);
    Vec3d by_first = Vec3d::Zero(), by_last = Vec3d::Zero();
    by_first[k] = by_along * -last[k] / (across * across);
    by_last[k] = by_along * first[k] / (across * across);
    CornerGradients by_corners = {Vec3d::Zero(), Vec3d::Zero(), Vec3d::Zero()};
    addEdges(flat, first, by_first, by_corners);
    addEdges(flat, last, by_last, by_corners);
    addCorners(crossing.triangle, by_corners);
  }
  const auto addPixel = [&](uint32_t pixel) {
    const uint32_t t = view.triangles[pixel];
    if (t == MeshView::kNoTriangle) return;
    const Vec3d by(by_pixel[pixel * 4], by_pixel[pixel * 4 + 1], by_pixel[pixel * 4 + 2]);
    if (by.isZero(0)) return;
    const uint32_t* v = &triangles_[size_t{t} * 3];
    const FlatTriangle& flat = view.flat[t];
    const Vec3d edges = edgesAt(flat, rayOf(camera, pixel));
    const double sum = edges.sum();
    const Vec3d weights = edges / sum;
    const Vec3d by_weights(by.dot(colours[v[0]]), by.dot(colours[v[1]]), by.dot(colours[v[2]]));
    for (Eigen::Index i = 0; i < 3; ++i) by_colour[v[i]] += weights[i] * by;
    const Vec3d by_edges = (by_weights.array() - by_weights.dot(weights)) / sum;
    CornerGradients by_corners = {Vec3d::Zero(), Vec3d::Zero(), Vec3d::Zero()};
    addEdges(flat, edges, by_edges, by_corners);
    addCorners(t, by_corners);
  };
  view.forEachRow([&](uint32_t begin, uint32_t end) {
    for (uint32_t pixel = begin; pixel < end; ++pixel) addPixel(pixel);
  });
}

}  // namespace stipple
