// Sphere templates onto targets with density off, uniform and adaptive, and with a Laplacian
// penalty: how far they are from the target, as a whole and where it is most curved. By hand:
//   mesh_adaptation [--steps N] [--sides A,B] [--modes off,adaptive] [--penalty W] [--last SHARE]
//   [--step S] [--smoothness L] [--strength W] [--factor K] [--seed S]
//   [--images N] [--image-size PIXELS] [--draw splats] ripples warts TARGET.glb...
// ripples and warts are made here, the .glb files by make_adapt_targets.py. With --images, the
// sphere sees N images of the target in place of its surface.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <map>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "../native/fit/mesh_images.h"
#include "fit/registration/picture_registration.h"
#include "fit/registration/registration.h"
#include "io/mesh_file.h"
#include "math/cross_product.h"
#include "mesh/adapt/merged_vertices.h"
#include "mesh/adapt/mesh_links.h"
#include "mesh/adapt/point_rows.h"
#include "mesh/surface_search.h"
#include "train/backend/backend_factory.h"

namespace {

using namespace stipple;

constexpr size_t kSamples = 100000;

/// A unit sphere: the grid of a cube's faces, 6 side^2 + 2 vertices.
TriMesh cubeSphere(int side) {
  TriMesh mesh;
  mesh.materials.resize(1);
  std::map<std::array<int, 3>, uint32_t> index;
  const auto vertex = [&](std::array<int, 3> key) {
    const auto [entry, is_new] = index.emplace(key, static_cast<uint32_t>(mesh.vertexCount()));
    if (is_new) {
      Vec3d p;
      for (int axis = 0; axis < 3; ++axis) {
        const double along = 2.0 * key[static_cast<size_t>(axis)] / side - 1;
        p[axis] = std::tan(along * 0.7853981633974483);
      }
      p.normalize();
      for (int axis = 0; axis < 3; ++axis) mesh.positions.push_back(static_cast<float>(p[axis]));
    }
    return entry->second;
  };
  for (size_t axis = 0; axis < 3; ++axis) {
    for (const int end : {0, side}) {
      for (int i = 0; i < side; ++i) {
        for (int j = 0; j < side; ++j) {
          std::array<uint32_t, 4> quad;
          const int steps[4][2] = {{i, j}, {i + 1, j}, {i + 1, j + 1}, {i, j + 1}};
          for (size_t corner = 0; corner < 4; ++corner) {
            std::array<int, 3> key;
            key[axis] = end;
            key[(axis + 1) % 3] = steps[corner][0];
            key[(axis + 2) % 3] = steps[corner][1];
            quad[corner] = vertex(key);
          }
          if (end == 0) std::reverse(quad.begin(), quad.end());
          mesh.triangles.insert(mesh.triangles.end(),
                                {quad[0], quad[1], quad[2], quad[0], quad[2], quad[3]});
        }
      }
    }
  }
  return mesh;
}

/// A smooth body with a patch of fine ripples.
double ripples(const Vec3d& p) {
  const double patch = std::exp(-(p - Vec3d(0.8, 0.6, 0)).squaredNorm() / 0.15);
  return 1 + 0.15 * std::sin(2 * p[0] + 1) * std::cos(3 * p[2]) +
         0.04 * patch * std::sin(28 * p[1]) * std::sin(28 * p[2]);
}

/// A body with warts, small and many on one side, few and large on the other.
double warts(const Vec3d& p) {
  double height = 1 + 0.1 * p[0] * p[1];
  for (int i = 0; i < 60; ++i) {
    // Fibonacci's lattice, the upper part of it closer together.
    const double z = 1 - 1.2 * std::pow((i + 0.5) / 60, 1.5);
    const double turn = 2.399963229728653 * i, r = std::sqrt(std::max(0.0, 1 - z * z));
    const Vec3d at(r * std::cos(turn), r * std::sin(turn), z);
    const double width = 0.045 + 0.06 * (1 - z) / 2;
    height += 0.9 * width * std::exp(-(p - at).squaredNorm() / (width * width));
  }
  return height;
}

TriMesh shaped(double (*radius)(const Vec3d&)) {
  TriMesh mesh = cubeSphere(180);
  for (size_t v = 0; v < mesh.vertexCount(); ++v) {
    const Vec3d p = rowOf(mesh.positions, v);
    setRow(mesh.positions, v, p * radius(p));
  }
  return mesh;
}

Vec3d faceNormal(const TriMesh& mesh, size_t t) {
  const Vec3d a = rowOf(mesh.positions, mesh.triangles[t * 3]);
  const Vec3d across = crossProduct(rowOf(mesh.positions, mesh.triangles[t * 3 + 1]) - a,
                                    rowOf(mesh.positions, mesh.triangles[t * 3 + 2]) - a);
  return across.norm() > 0 ? (across / across.norm()).eval() : Vec3d::Zero().eval();
}

struct Places {
  std::vector<Vec3d> points, normals;
  std::vector<uint32_t> triangles;
};

Places sampled(const TriMesh& mesh, uint64_t seed) {
  std::vector<Vec3d> positions;
  for (size_t v = 0; v < mesh.vertexCount(); ++v) positions.push_back(rowOf(mesh.positions, v));
  Places made;
  for (const SurfaceSample& sample : spreadSamples(mesh.triangles, positions, kSamples, seed)) {
    made.points.push_back(sample.at(mesh.triangles, positions));
    made.normals.push_back(faceNormal(mesh, sample.triangle));
    made.triangles.push_back(sample.triangle);
  }
  return made;
}

/// Of each triangle: how far normals turn per length along the edges of its corners, mean. Borders
/// count for nothing.
std::vector<double> curvatures(const TriMesh& mesh) {
  const MergedVertices merged = mergeVertices(mesh.positions, mesh.triangles);
  const MeshLinks links(merged.positions.size(), merged.triangles);
  std::vector<Vec3d> normals(merged.positions.size(), Vec3d::Zero());
  for (size_t corner = 0; corner < merged.triangles.size(); ++corner) {
    normals[merged.triangles[corner]] +=
        areaVector(merged.triangles, merged.positions, static_cast<uint32_t>(corner / 3));
  }
  for (Vec3d& n : normals) n.normalize();
  std::vector<double> of_vertex(normals.size(), 0.0);
  for (size_t v = 0; v < normals.size(); ++v) {
    if (links.isBorder(v)) continue;
    for (const uint32_t other : links.neighbours(v)) {
      of_vertex[v] += (normals[v] - normals[other]).norm() /
                      ((merged.positions[v] - merged.positions[other]).norm() + 1e-12) /
                      static_cast<double>(links.neighbours(v).size());
    }
  }
  std::vector<double> of_triangle(mesh.triangleCount(), 0.0);
  for (size_t corner = 0; corner < mesh.triangles.size(); ++corner) {
    of_triangle[corner / 3] += of_vertex[merged.place_of[mesh.triangles[corner]]] / 3;
  }
  return of_triangle;
}

struct Figures {
  double chamfer = 0, normals = 0, salient_chamfer = 0, salient_normals = 0;
};

/// Both ways, as a whole and over the fifth of the target (by area) that is most curved, and over
/// what comes nearest to it.
Figures measured(const TriMesh& made, const TriMesh& target, const Places& of_target,
                 const std::vector<double>& curvature, double least) {
  const SurfaceSearch on_made(made.positions, made.triangles);
  const SurfaceSearch on_target(target.positions, target.triangles);
  std::vector<SurfacePlace> places;
  double sums[2][4] = {}, counts[2][2] = {};
  const auto add = [&](int way, double distance, double normal, bool salient) {
    sums[way][0] += distance;
    sums[way][1] += normal;
    counts[way][0] += 1;
    if (!salient) return;
    sums[way][2] += distance;
    sums[way][3] += normal;
    counts[way][1] += 1;
  };
  for (size_t i = 0; i < of_target.points.size(); ++i) {
    on_made.nearest(of_target.points[i], 1, places);
    add(0, std::sqrt(places[0].squared),
        (of_target.normals[i] - faceNormal(made, places[0].triangle)).squaredNorm(),
        curvature[of_target.triangles[i]] >= least);
  }
  const Places of_made = sampled(made, 5);
  for (size_t i = 0; i < of_made.points.size(); ++i) {
    on_target.nearest(of_made.points[i], 1, places);
    add(1, std::sqrt(places[0].squared),
        (of_made.normals[i] - faceNormal(target, places[0].triangle)).squaredNorm(),
        curvature[places[0].triangle] >= least);
  }
  const auto both = [&](int which) {
    const int count = which < 2 ? 0 : 1;
    return 0.5 *
           (sums[0][which] / counts[0][count] + sums[1][which] / std::max(1.0, counts[1][count]));
  };
  return {both(0), both(1), both(2), both(3)};
}

/// Faces whose normal is turned from the mean of their neighbours' by more than 120 degrees.
size_t flippedFaces(const TriMesh& mesh) {
  const MergedVertices merged = mergeVertices(mesh.positions, mesh.triangles);
  std::map<std::pair<uint32_t, uint32_t>, std::vector<size_t>> of_edge;
  for (size_t t = 0; t < merged.triangles.size() / 3; ++t) {
    for (size_t c = 0; c < 3; ++c) {
      const uint32_t a = merged.triangles[t * 3 + c], b = merged.triangles[t * 3 + (c + 1) % 3];
      of_edge[std::minmax(a, b)].push_back(t);
    }
  }
  const auto normal = [&](size_t t) {
    const Vec3d n = areaVector(merged.triangles, merged.positions, static_cast<uint32_t>(t));
    return n.norm() > 0 ? (n / n.norm()).eval() : n;
  };
  std::vector<Vec3d> around(merged.triangles.size() / 3, Vec3d::Zero());
  for (const auto& [edge, faces] : of_edge) {
    if (faces.size() != 2) continue;
    around[faces[0]] += normal(faces[1]);
    around[faces[1]] += normal(faces[0]);
  }
  size_t count = 0;
  for (size_t t = 0; t < around.size(); ++t) {
    if (around[t].norm() > 0 && normal(t).dot(around[t].normalized()) < -0.5) ++count;
  }
  return count;
}

bool crosses(const Vec3d& from, const Vec3d& to, const std::array<Vec3d, 3>& face) {
  const Vec3d along = to - from, first = face[1] - face[0], second = face[2] - face[0];
  const Vec3d p = crossProduct(along, second);
  const double scale = first.dot(p);
  if (std::abs(scale) < 1e-18) return false;
  const Vec3d start = from - face[0];
  const double u = start.dot(p) / scale;
  const Vec3d q = crossProduct(start, first);
  const double v = along.dot(q) / scale, t = second.dot(q) / scale;
  return u >= 0 && v >= 0 && u + v <= 1 && t >= 0 && t <= 1;
}

/// Pairs of triangles without a common vertex of which an edge of one passes through the other.
size_t selfIntersections(const TriMesh& mesh) {
  const size_t count = mesh.triangleCount();
  std::vector<std::array<Vec3d, 3>> faces(count);
  std::vector<std::pair<double, double>> reach(count);
  for (size_t t = 0; t < count; ++t) {
    for (size_t c = 0; c < 3; ++c) faces[t][c] = rowOf(mesh.positions, mesh.triangles[t * 3 + c]);
    reach[t] = std::minmax({faces[t][0][0], faces[t][1][0], faces[t][2][0]});
  }
  std::vector<uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(),
            [&](uint32_t a, uint32_t b) { return reach[a].first < reach[b].first; });
  const auto apart = [&](uint32_t a, uint32_t b) {
    for (int axis = 1; axis < 3; ++axis) {
      const auto p = std::minmax({faces[a][0][axis], faces[a][1][axis], faces[a][2][axis]});
      const auto q = std::minmax({faces[b][0][axis], faces[b][1][axis], faces[b][2][axis]});
      if (p.second < q.first || q.second < p.first) return true;
    }
    return false;
  };
  const auto touch = [&](uint32_t a, uint32_t b) {
    for (size_t i = 0; i < 3; ++i) {
      for (size_t j = 0; j < 3; ++j) {
        if (mesh.triangles[a * size_t{3} + i] == mesh.triangles[b * size_t{3} + j]) return true;
      }
    }
    return false;
  };
  size_t found = 0;
  for (size_t i = 0; i < count; ++i) {
    for (size_t j = i + 1; j < count && reach[order[j]].first <= reach[order[i]].second; ++j) {
      const uint32_t a = order[i], b = order[j];
      if (apart(a, b) || touch(a, b)) continue;
      bool meets = false;
      for (size_t c = 0; c < 3 && !meets; ++c) {
        meets = crosses(faces[a][c], faces[a][(c + 1) % 3], faces[b]) ||
                crosses(faces[b][c], faces[b][(c + 1) % 3], faces[a]);
      }
      if (meets) ++found;
    }
  }
  return found;
}

struct Study {
  std::vector<int> sides = {18, 41};
  std::string modes = "off,uniform,adaptive,laplacian";
  double penalty = 0.2;
  size_t image_count = 0;
  RegistrationOptions options;
};

void compare(const std::string& name, const TriMesh& target, const Study& study) {
  const MergedVertices merged = mergeVertices(target.positions, target.triangles);
  const MemoryViewSource pictures =
      imagesOf(merged.positions, merged.triangles, study.image_count, study.options.picture_side);
  const std::vector<double> curvature = curvatures(target);
  const Places of_target = sampled(target, 4);
  std::vector<double> sorted;
  for (const uint32_t t : of_target.triangles) sorted.push_back(curvature[t]);
  const auto fifth = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() * 4 / 5);
  std::nth_element(sorted.begin(), fifth, sorted.end());
  for (const int side : study.sides) {
    const TriMesh given = cubeSphere(side);
    for (const char* mode : {"off", "uniform", "adaptive", "laplacian"}) {
      if (study.modes.find(mode) == std::string::npos) continue;
      RegistrationOptions options = study.options;
      options.adapter.density = mode[0] == 'u'   ? MeshDensity::kUniform
                                : mode[0] == 'a' ? MeshDensity::kAdaptive
                                                 : MeshDensity::kOff;
      if (mode[0] == 'l') options.adapter.laplacian = study.penalty;
      const auto start = std::chrono::steady_clock::now();
      const RegisteredMesh made =
          study.image_count > 0
              ? registerToPictures(given, pictures, options, *cpuBackends())
              : registerMesh(given, targetOfMesh(target, options.target_count, options.seed),
                             options);
      const double seconds =
          std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      const Figures seen = measured(made.mesh, target, of_target, curvature, *fifth);
      std::printf("%s | %zu | %s | %.6f | %.6f | %.4f | %.4f | %zu | %zu | %.1f\n", name.c_str(),
                  given.vertexCount(), mode, seen.chamfer, seen.salient_chamfer, seen.normals,
                  seen.salient_normals, flippedFaces(made.mesh), selfIntersections(made.mesh),
                  seconds);
      std::fflush(stdout);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  Study study;
  RegistrationOptions& options = study.options;
  options.alignment = PreAlignment::kSize;
  options.report_count = 0;
  std::vector<std::string> targets;
  const std::map<std::string, std::function<void(const char*)>> known = {
      {"--steps",
       [&](const char* text) { options.adapter.steps = static_cast<uint32_t>(std::atoi(text)); }},
      {"--penalty", [&](const char* text) { study.penalty = std::atof(text); }},
      {"--last", [&](const char* text) { options.adapter.last_share = std::atof(text); }},
      {"--step", [&](const char* text) { options.adapter.step_size = std::atof(text); }},
      {"--smoothness", [&](const char* text) { options.adapter.smoothness = std::atof(text); }},
      {"--strength", [&](const char* text) { options.adapter.strength = std::atof(text); }},
      {"--factor", [&](const char* text) { options.adapter.adaptive_factor = std::atof(text); }},
      {"--images",
       [&](const char* text) { study.image_count = static_cast<size_t>(std::atoi(text)); }},
      {"--image-size",
       [&](const char* text) { options.picture_side = static_cast<uint32_t>(std::atoi(text)); }},
      {"--draw",
       [&](const char* text) {
         options.picture_drawing =
             text[0] == 's' ? PictureDrawing::kSplats : PictureDrawing::kTriangles;
       }},
      {"--modes", [&](const char* text) { study.modes = text; }},
      {"--seed", [&](const char* text) { options.seed = static_cast<uint64_t>(std::atoi(text)); }},
      {"--sides", [&](const char* text) {
         study.sides.clear();
         for (const char* at = text; at; at = std::strchr(at, ',')) {
           if (*at == ',') ++at;
           study.sides.push_back(std::atoi(at));
         }
       }}};
  for (int i = 1; i < argc; ++i) {
    const auto found = known.find(argv[i]);
    if (found != known.end() && i + 1 < argc) {
      found->second(argv[++i]);
    } else {
      targets.emplace_back(argv[i]);
    }
  }
  std::printf(
      "target | vertices | density | chamfer | salient | normals | salient | flipped | "
      "crossings | seconds\n");
  for (const std::string& path : targets) {
    if (path == "ripples" || path == "warts") {
      compare(path, shaped(path == "warts" ? warts : ripples), study);
    } else {
      compare(path, readMeshFile(path), study);
    }
  }
  return 0;
}
