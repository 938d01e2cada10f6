#include <gmock/gmock.h>

#include <unistd.h>

#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include "api/fixtures.h"

// Meshes of splats, by way of a volume: closed, where the closed form puts them, and messages where
// there is none.

namespace stipple::test {
namespace {

using ::testing::HasSubstr;

constexpr double kPi = 3.14159265358979323846;

struct Splats {
  std::vector<float> positions, rotations, scales, opacities, sh;

  void add(const std::array<double, 3>& at, double size, double opacity) {
    for (const double value : at) positions.push_back(static_cast<float>(value));
    rotations.insert(rotations.end(), {1, 0, 0, 0});
    scales.insert(scales.end(), 3, static_cast<float>(size));
    opacities.push_back(static_cast<float>(opacity));
    sh.insert(sh.end(), 3, 0.0f);
  }
};

/// Splats on a sphere of radius 1, as scans are: a thin shell.
Splats shell(int count, double size) {
  Splats splats;
  for (int i = 0; i < count; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / count;
    const double angle = i * kPi * (3.0 - std::sqrt(5.0));
    const double r = std::sqrt(1.0 - z * z);
    splats.add({r * std::cos(angle), r * std::sin(angle), z}, size, 0.95);
  }
  return splats;
}

class ProxyMesh : public ApiTest {
 protected:
  StippleVolume* voxelize(const Splats& splats, double voxel_size, double low_pass = 0.5) {
    auto arrays = sized<StippleCloudArrays>();
    arrays.count = splats.opacities.size();
    arrays.positions = splats.positions.data();
    arrays.rotations = splats.rotations.data();
    arrays.scales = splats.scales.data();
    arrays.opacities = splats.opacities.data();
    arrays.sh = splats.sh.data();
    StippleCloud* cloud = nullptr;
    STIPPLE_EXPECT_OK(stipple_cloud_create(context_, &arrays, &cloud));
    const StippleInstance instance = placed(cloud);
    StippleVoxelizeOptions options;
    stipple_voxelize_options_init(&options);
    options.voxel_size = voxel_size;
    options.low_pass = low_pass;
    StippleJob* job = nullptr;
    STIPPLE_EXPECT_OK(stipple_voxelize_start(context_, &instance, 1, &options, &job));
    STIPPLE_EXPECT_OK(stipple_job_wait(job));
    StippleVolume* volume = nullptr;
    STIPPLE_EXPECT_OK(stipple_job_volume(job, &volume));
    stipple_job_free(job);
    stipple_cloud_free(cloud);
    return volume;
  }

  static StippleVolumeToMeshOptions options() {
    StippleVolumeToMeshOptions made;
    stipple_volume_to_mesh_options_init(&made);
    return made;
  }

  /// Waits; null where it fails, and then its message is this thread's.
  static StippleMesh* meshOf(const StippleVolume* volume,
                             const StippleVolumeToMeshOptions& settings) {
    StippleJob* job = nullptr;
    StippleMesh* mesh = nullptr;
    if (stipple_volume_to_mesh_start(volume, &settings, &job) != STIPPLE_OK) return nullptr;
    if (stipple_job_wait(job) == STIPPLE_OK) {
      STIPPLE_EXPECT_OK(stipple_job_mesh(job, &mesh));
    }
    if (!mesh) {
      const std::string message = stipple_last_error_message();
      stipple_job_free(job);
      EXPECT_NE(message, "");
      message_ = message;
      return nullptr;
    }
    stipple_job_free(job);
    return mesh;
  }

  static StippleMeshTopology topologyOf(const StippleMesh* mesh) {
    auto topology = sized<StippleMeshTopology>();
    STIPPLE_EXPECT_OK(stipple_mesh_topology(mesh, &topology));
    return topology;
  }

  struct Arrays {
    std::vector<float> positions;
    std::vector<uint32_t> triangles;
  };
  static Arrays read(const StippleMesh* mesh) {
    auto info = sized<StippleMeshInfo>();
    STIPPLE_EXPECT_OK(stipple_mesh_info(mesh, &info));
    Arrays arrays;
    arrays.positions.resize(info.vertex_count * 3);
    arrays.triangles.resize(info.triangle_count * 3);
    auto buffers = sized<StippleMeshBuffers>();
    buffers.vertex_capacity = info.vertex_count;
    buffers.triangle_capacity = info.triangle_count;
    buffers.positions = arrays.positions.data();
    buffers.triangles = arrays.triangles.data();
    STIPPLE_EXPECT_OK(stipple_mesh_read(mesh, &buffers));
    return arrays;
  }

  static std::string message_;
};

std::string ProxyMesh::message_;

/// Radius at which one round splat has this extinction: Li_1/2(o exp(-m^2/2)) / (sqrt(2 pi) s).
double radiusAt(double density, double opacity, double size) {
  const auto extinction = [&](double radius) {
    const double m = radius / size;
    double sum = 0;
    double power = 1;
    const double z = opacity * std::exp(-0.5 * m * m);
    for (int k = 1; k < 4000; ++k) {
      power *= z;
      sum += power / std::sqrt(static_cast<double>(k));
    }
    return sum / (std::sqrt(2 * kPi) * size);
  };
  double low = 0, high = 4 * size;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (extinction(middle) > density ? low : high) = middle;
  }
  return low;
}

TEST_F(ProxyMesh, OfOneSplatIsTheSphereOfTheClosedForm) {
  Splats splats;
  splats.add({0.3, -0.2, 7}, 0.5, 0.9);
  const double voxel = 0.05;
  StippleVolume* volume = voxelize(splats, voxel, 0.0);
  for (const double density : {0.1, 0.5, 1.0}) {
    StippleVolumeToMeshOptions settings = options();
    settings.density = density;
    StippleMesh* mesh = meshOf(volume, settings);
    ASSERT_NE(mesh, nullptr) << message_;
    const StippleMeshTopology topology = topologyOf(mesh);
    EXPECT_EQ(topology.open_edge_count, 0u);
    EXPECT_EQ(topology.euler, 2);
    EXPECT_EQ(topology.piece_count, 1u);
    const double radius = radiusAt(density, 0.9, 0.5);
    // A vertex is the mean of points on the sphere in its cell, h^2 / 8r inside of it; facets lie
    // as much inside again: 3/4 (h/r)^2 of the volume together, and up to 0.9 measured.
    const double share = voxel * voxel / (radius * radius);
    EXPECT_NEAR(topology.volume, 4.0 / 3.0 * kPi * radius * radius * radius,
                4.0 / 3.0 * kPi * radius * radius * radius * share);
    const Arrays arrays = read(mesh);
    for (size_t i = 0; i < arrays.positions.size(); i += 3) {
      const double d =
          std::hypot(double(arrays.positions[i]) - 0.3, double(arrays.positions[i + 1]) + 0.2,
                     double(arrays.positions[i + 2]) - 7);
      // Dual vertices lie inside their cell, within half a voxel of the surface; measured 0.1.
      EXPECT_NEAR(d, radius, 0.25 * voxel);
    }
    stipple_mesh_free(mesh);
  }
  stipple_volume_free(volume);
}

TEST_F(ProxyMesh, OfAShellOfSplatsHasAnOutsideAndAHollow) {
  StippleVolume* volume = voxelize(shell(4000, 0.03), 0.04);
  StippleMesh* whole = meshOf(volume, options());
  ASSERT_NE(whole, nullptr) << message_;
  const StippleMeshTopology both = topologyOf(whole);
  EXPECT_EQ(both.open_edge_count, 0u);
  EXPECT_EQ(both.piece_count, 2u);
  EXPECT_EQ(both.euler, 4);  // two spheres
  StippleVolumeToMeshOptions settings = options();
  settings.largest_only = 1;
  StippleMesh* solid = meshOf(volume, settings);
  const StippleMeshTopology outside = topologyOf(solid);
  EXPECT_EQ(outside.open_edge_count, 0u);
  EXPECT_EQ(outside.euler, 2);
  // The surface lies up to two voxels outside the splats' centres.
  EXPECT_GT(outside.volume, 4.0 / 3.0 * kPi);
  EXPECT_LT(outside.volume, 4.0 / 3.0 * kPi * std::pow(1.08, 3));
  stipple_mesh_free(solid);
  stipple_mesh_free(whole);
  stipple_volume_free(volume);
}

TEST_F(ProxyMesh, IsClosedForEveryThresholdOfNoise) {
  // Splats of a voxel's size at random: every ambiguous case of a grid occurs.
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(0, 1);
  Splats splats;
  for (int i = 0; i < 3000; ++i) {
    splats.add({unit(random), unit(random), unit(random)}, 0.01 + 0.03 * unit(random),
               0.2 + 0.75 * unit(random));
  }
  StippleVolume* volume = voxelize(splats, 0.03);
  for (const double opacity : {0.05, 0.2, 0.35, 0.5, 0.65, 0.8}) {
    for (const double adaptivity : {0.0, 0.3, 1.0}) {
      StippleVolumeToMeshOptions settings = options();
      settings.opacity = opacity;
      settings.adaptivity = adaptivity;
      StippleMesh* mesh = meshOf(volume, settings);
      ASSERT_NE(mesh, nullptr) << message_;
      const StippleMeshTopology topology = topologyOf(mesh);
      EXPECT_EQ(topology.open_edge_count, 0u)
          << opacity << " " << adaptivity << " of " << topology.edge_count;
      EXPECT_GT(topology.volume, 0);
      stipple_mesh_free(mesh);
    }
  }
  stipple_volume_free(volume);
}

TEST_F(ProxyMesh, IsClosedWhereTheStoredVoxelsEnd) {
  // A threshold below what is stored: the surface lies at the end of the voxels.
  Splats splats;
  splats.add({0, 0, 0}, 0.3, 0.9);
  StippleVolume* volume = voxelize(splats, 0.1);
  StippleVolumeToMeshOptions settings = options();
  settings.density = 1e-5;
  StippleMesh* mesh = meshOf(volume, settings);
  ASSERT_NE(mesh, nullptr) << message_;
  EXPECT_EQ(topologyOf(mesh).open_edge_count, 0u);
  EXPECT_EQ(topologyOf(mesh).euler, 2);
  stipple_mesh_free(mesh);
  stipple_volume_free(volume);
}

TEST_F(ProxyMesh, HasFewerFacesWhereItMayAdapt) {
  Splats splats;
  splats.add({0, 0, 0}, 0.5, 0.9);
  StippleVolume* volume = voxelize(splats, 0.03);
  StippleVolumeToMeshOptions settings = options();
  settings.density = 0.5;
  StippleMesh* fine = meshOf(volume, settings);
  settings.adaptivity = 0.5;
  StippleMesh* coarse = meshOf(volume, settings);
  const Arrays a = read(fine), b = read(coarse);
  EXPECT_LT(b.triangles.size(), a.triangles.size() / 2);
  EXPECT_EQ(topologyOf(coarse).euler, 2);
  // Larger faces cut more off a sphere: 0.08 measured.
  EXPECT_NEAR(topologyOf(coarse).volume, topologyOf(fine).volume, 0.1 * topologyOf(fine).volume);
  stipple_mesh_free(coarse);
  stipple_mesh_free(fine);
  stipple_volume_free(volume);
}

TEST_F(ProxyMesh, DoesNotDependOnTheNumberOfThreads) {
  StippleVolume* volume = voxelize(shell(2000, 0.04), 0.03);
  StippleMesh* one = meshOf(volume, options());
  StippleMesh* again = meshOf(volume, options());
  EXPECT_EQ(read(one).positions, read(again).positions);
  EXPECT_EQ(read(one).triangles, read(again).triangles);
  StippleContext* single = withThreadCount(1);
  const std::string path =
      (std::filesystem::temp_directory_path() / ("proxy" + std::to_string(getpid()) + ".vdb"))
          .string();
  STIPPLE_ASSERT_OK(stipple_volume_save(volume, path.c_str()));
  StippleVolume* loaded = nullptr;
  STIPPLE_ASSERT_OK(stipple_volume_load(single, path.c_str(), &loaded));
  StippleMesh* alone = meshOf(loaded, options());
  EXPECT_EQ(read(one).positions, read(alone).positions);
  EXPECT_EQ(read(one).triangles, read(alone).triangles);
  std::filesystem::remove(path);
  stipple_mesh_free(alone);
  stipple_volume_free(loaded);
  stipple_context_free(single);
  stipple_mesh_free(again);
  stipple_mesh_free(one);
  stipple_volume_free(volume);
}

TEST_F(ProxyMesh, SaysTheLargestDensityWhereNothingReachesTheThreshold) {
  Splats splats;
  splats.add({0, 0, 0}, 0.5, 0.5);
  StippleVolume* volume = voxelize(splats, 0.1);
  auto info = sized<StippleVolumeInfo>();
  STIPPLE_ASSERT_OK(stipple_volume_info(volume, &info));
  char largest[64];
  std::snprintf(largest, sizeof(largest), "the densest has %.4g per metre", info.max_density);
  StippleVolumeToMeshOptions settings = options();
  settings.opacity = 0.99;
  EXPECT_EQ(meshOf(volume, settings), nullptr);
  EXPECT_THAT(message_, HasSubstr(largest));
  EXPECT_THAT(message_, HasSubstr("choose a threshold below that"));
  stipple_volume_free(volume);
}

TEST_F(ProxyMesh, RefusesWhatItCannotMake) {
  Splats splats;
  splats.add({0, 0, 0}, 0.5, 0.9);
  StippleVolume* volume = voxelize(splats, 0.1);
  StippleJob* job = nullptr;
  StippleVolumeToMeshOptions settings = options();
  settings.opacity = 1.0;
  EXPECT_EQ(stipple_volume_to_mesh_start(volume, &settings, &job), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_THAT(stipple_last_error_message(), HasSubstr("opacity is 1.000000"));
  settings = options();
  settings.adaptivity = 2;
  EXPECT_EQ(meshOf(volume, settings), nullptr);
  EXPECT_EQ(message_, "adaptivity is 2; 0 to 1 is allowed");
  settings = options();
  settings.density = -1;
  EXPECT_EQ(meshOf(volume, settings), nullptr);
  EXPECT_THAT(message_, HasSubstr("threshold is -1 per metre"));
  stipple_volume_free(volume);

  Splats faint;
  faint.add({0, 0, 0}, 0.5, 1e-4);
  StippleVolume* empty = voxelize(faint, 0.1);
  EXPECT_EQ(meshOf(empty, options()), nullptr);
  EXPECT_THAT(message_, HasSubstr("the volume is empty"));
  stipple_volume_free(empty);
}

TEST_F(ProxyMesh, EndsAsCancelled) {
  StippleVolume* volume = voxelize(shell(2000, 0.04), 0.02);
  const StippleVolumeToMeshOptions settings = options();
  StippleJob* job = nullptr;
  STIPPLE_ASSERT_OK(stipple_volume_to_mesh_start(volume, &settings, &job));
  STIPPLE_EXPECT_OK(stipple_job_cancel(job));
  EXPECT_EQ(stipple_job_wait(job), STIPPLE_ERROR_CANCELLED);
  StippleMesh* mesh = nullptr;
  EXPECT_EQ(stipple_job_mesh(job, &mesh), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(mesh, nullptr);
  stipple_job_free(job);
  stipple_volume_free(volume);
}

TEST_F(ProxyMesh, RefusesMoreMemoryThanAllowed) {
  StippleVolume* volume = voxelize(shell(2000, 0.04), 0.02);
  const StippleVolumeToMeshOptions settings = options();
  uint64_t bound = 0;
  STIPPLE_ASSERT_OK(stipple_volume_to_mesh_memory_bound(volume, &settings, &bound));
  StippleMesh* mesh = meshOf(volume, settings);
  const Arrays arrays = read(mesh);
  EXPECT_GT(bound, arrays.positions.size() * 4 + arrays.triangles.size() * 4);
  stipple_mesh_free(mesh);
  const std::string path =
      (std::filesystem::temp_directory_path() / ("limit" + std::to_string(getpid()) + ".vdb"))
          .string();
  STIPPLE_ASSERT_OK(stipple_volume_save(volume, path.c_str()));
  StippleContextOptions small;
  stipple_context_options_init(&small);
  small.memory_limit_bytes = bound - 1;
  StippleContext* context = nullptr;
  STIPPLE_ASSERT_OK(stipple_context_create(&small, &context));
  StippleVolume* loaded = nullptr;
  STIPPLE_ASSERT_OK(stipple_volume_load(context, path.c_str(), &loaded));
  StippleJob* job = nullptr;
  EXPECT_EQ(stipple_volume_to_mesh_start(loaded, &settings, &job), STIPPLE_ERROR_MEMORY_LIMIT);
  EXPECT_EQ(job, nullptr);
  EXPECT_THAT(stipple_last_error_message(), HasSubstr("the mesh of a volume"));
  std::filesystem::remove(path);
  stipple_volume_free(loaded);
  stipple_context_free(context);
  stipple_volume_free(volume);
}

TEST_F(ProxyMesh, IsWrittenAndReadBack) {
  Splats splats;
  splats.add({0.5, 1, 2}, 0.5, 0.9);
  StippleVolume* volume = voxelize(splats, 0.1);
  StippleVolumeToMeshOptions settings = options();
  settings.density = 0.5;
  StippleMesh* mesh = meshOf(volume, settings);
  const Arrays arrays = read(mesh);
  const std::string stem =
      (std::filesystem::temp_directory_path() / ("mesh" + std::to_string(getpid()))).string();
  STIPPLE_ASSERT_OK(stipple_mesh_save(mesh, (stem + ".glb").c_str()));
  StippleMesh* back = nullptr;
  STIPPLE_ASSERT_OK(stipple_mesh_load(context_, (stem + ".glb").c_str(), &back));
  const Arrays seen = read(back);
  EXPECT_EQ(seen.triangles, arrays.triangles);
  ASSERT_EQ(seen.positions.size(), arrays.positions.size());
  for (size_t i = 0; i < seen.positions.size(); ++i) {
    EXPECT_EQ(seen.positions[i], arrays.positions[i]);
  }
  STIPPLE_ASSERT_OK(stipple_mesh_save(mesh, (stem + ".ply").c_str()));
  std::ifstream file(stem + ".ply", std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  const size_t data = bytes.find("end_header\n") + 11;
  EXPECT_THAT(bytes.substr(0, data),
              HasSubstr("element vertex " + std::to_string(arrays.positions.size() / 3)));
  ASSERT_EQ(bytes.size() - data, arrays.positions.size() * 4 + arrays.triangles.size() / 3 * 13);
  EXPECT_EQ(std::memcmp(&bytes[data], arrays.positions.data(), arrays.positions.size() * 4), 0);
  uint32_t first[3];
  std::memcpy(first, &bytes[data + arrays.positions.size() * 4 + 1], 12);
  EXPECT_EQ(first[0], arrays.triangles[0]);
  EXPECT_EQ(stipple_mesh_save(mesh, (stem + ".obj").c_str()), STIPPLE_ERROR_UNSUPPORTED);
  EXPECT_THAT(stipple_last_error_message(), HasSubstr(".ply and .glb are supported"));
  EXPECT_EQ(stipple_mesh_save(mesh, "/nowhere/mesh.ply"), STIPPLE_ERROR_IO);
  auto buffers = sized<StippleMeshBuffers>();
  float one[3];
  buffers.positions = one;
  buffers.vertex_capacity = 1;
  EXPECT_EQ(stipple_mesh_read(mesh, &buffers), STIPPLE_ERROR_BUFFER_TOO_SMALL);
  for (const char* extension : {".glb", ".ply"}) std::filesystem::remove(stem + extension);
  stipple_mesh_free(back);
  stipple_mesh_free(mesh);
  stipple_volume_free(volume);
}

}  // namespace
}  // namespace stipple::test
