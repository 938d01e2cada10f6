// The only file that sees OpenVDB's headers: they take half a minute to compile.
#include <openvdb/openvdb.h>
#include <openvdb/tools/VolumeToMesh.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "data/sparse_volume.h"
#include "io/bytes/input_file.h"
#include "io/bytes/limits.h"
#include "io/media/media_calls.h"
#include "io/media/volume_header.h"

namespace stipple::media {

namespace {

constexpr char kDensityName[] = "density";
constexpr char kColourName[] = "color";
constexpr size_t kVoxels = kBrickVoxelCount;
constexpr size_t kBricksPerTask = 256;
// 512 M voxels are 8 GiB of density and colour.
constexpr openvdb::Index64 kMaxVoxels = openvdb::Index64{1} << 29;
constexpr openvdb::Index64 kVoxelBytes = 4 * sizeof(float);

// Some programs keep transforms as float32.
constexpr double kFrameTolerance = 1e-6;

using FloatLeaf = openvdb::FloatTree::LeafNodeType;
using ColourLeaf = openvdb::Vec3STree::LeafNodeType;
static_assert(FloatLeaf::SIZE == kVoxels && sizeof(openvdb::Vec3s) == 3 * sizeof(float),
              "bricks are copied into leaves as they are");

void initialiseOnce() {
  static std::once_flag once;
  std::call_once(once, [] { openvdb::initialize(); });
}

/// Leaves made in parallel from the bricks, values copied as they stand, zero where inactive.
template <typename Tree>
void fillTree(Tree& tree, const StippleMediaVolume& volume, const float* values, size_t width) {
  using Leaf = typename Tree::LeafNodeType;
  const size_t count = static_cast<size_t>(volume.brick_count);
  std::vector<Leaf*> leaves(count, nullptr);
  parallelFor(count, kBricksPerTask, [&](size_t begin, size_t end) {
    for (size_t b = begin; b < end; ++b) {
      const int32_t* at = volume.bricks + b * 3;
      leaves[b] = new Leaf(openvdb::Coord(at[0], at[1], at[2]),
                           openvdb::zeroVal<typename Tree::ValueType>());
      std::memcpy(static_cast<void*>(leaves[b]->buffer().data()), values + b * kVoxels * width,
                  kVoxels * width * sizeof(float));
      // Both grids are active in the same voxels: where either holds something.
      const float* density = volume.density + b * kVoxels;
      const float* colour = volume.colour + b * kVoxels * 3;
      for (size_t v = 0; v < kVoxels; ++v) {
        const float* rgb = colour + v * 3;
        if (density[v] != 0 || rgb[0] != 0 || rgb[1] != 0 || rgb[2] != 0) {
          leaves[b]->setValueOn(static_cast<openvdb::Index>(v));
        }
      }
    }
  });
  for (Leaf* leaf : leaves) tree.addLeaf(leaf);
}

/// OpenVDB's own file does not look whether the system takes what it writes; ours does.
class CheckedArchive : public openvdb::io::Archive {
 public:
  void writeFile(const char* path, const openvdb::GridPtrVec& grids) const {
    std::ofstream file(std::filesystem::path(path), std::ios::binary | std::ios::trunc);
    if (file) write(file, grids, /*seekable=*/true);
    finishFile(file, path);
  }
};

void writeVolume(const char* path, const StippleMediaVolume& volume) {
  const auto transform = openvdb::math::Transform::createLinearTransform(volume.voxel_size);
  transform->postTranslate(openvdb::Vec3d(volume.origin[0], volume.origin[1], volume.origin[2]));

  const auto density = openvdb::FloatGrid::create(0.0f);
  density->setName(kDensityName);
  density->setGridClass(openvdb::GRID_FOG_VOLUME);
  density->setTransform(transform);
  fillTree(density->tree(), volume, volume.density, 1);

  const auto colour = openvdb::Vec3SGrid::create(openvdb::Vec3s(0.0f));
  colour->setName(kColourName);
  colour->setVectorType(openvdb::VEC_INVARIANT);
  colour->setTransform(transform->copy());
  fillTree(colour->tree(), volume, volume.colour, 3);

  for (const openvdb::GridBase::Ptr& grid :
       {openvdb::GridBase::Ptr(density), openvdb::GridBase::Ptr(colour)}) {
    grid->setSaveFloatAsHalf(false);
    grid->setCreator("Stipple");
  }
  CheckedArchive archive;
  const uint32_t codec = openvdb::io::Archive::hasBloscCompression()  ? openvdb::io::COMPRESS_BLOSC
                         : openvdb::io::Archive::hasZLibCompression() ? openvdb::io::COMPRESS_ZIP
                                                                      : openvdb::io::COMPRESS_NONE;
  archive.setCompression(codec | openvdb::io::COMPRESS_ACTIVE_MASK);
  archive.writeFile(path, {density, colour});
}

/// An OpenVDB file, of which every length is known to lie inside it before OpenVDB believes it.
class CheckedFile {
 public:
  explicit CheckedFile(const char* path)
      : file_(path),
        header_(readVolumeHeader(file_)),
        stream_(std::filesystem::path(path), std::ios::binary) {
    // OpenVDB reads on after the end of a file, and takes what lies in memory for lengths.
    stream_.exceptions(std::ios::failbit | std::ios::badbit | std::ios::eofbit);
    openvdb::io::setVersion(stream_, {header_.library_major, header_.library_minor},
                            header_.file_version);
  }

  /// The grid of this name and type, its active tiles turned into leaves.
  template <typename Grid>
  typename Grid::Ptr take(const char* name) {
    const auto found = header_.grids.find(name);
    if (found == header_.grids.end()) {
      fail(ErrorCode::kFormat,
           file_.path() + " has no grid '" + name + "'; density and color are needed");
    }
    const std::string what = file_.path() + ": the grid '" + name + "'";
    const VolumeGridPlace& place = found->second;
    if (place.type != Grid::gridType()) {
      fail(ErrorCode::kFormat, what + " is not of the type " + Grid::gridType());
    }
    const auto grid = Grid::create();
    try {
      grid->setSaveFloatAsHalf(place.is_half);
      openvdb::io::setDataCompression(stream_, place.compression);
      stream_.seekg(static_cast<std::streamoff>(place.transform));
      grid->readTransform(stream_);
      grid->readTopology(stream_);
      stream_.seekg(static_cast<std::streamoff>(place.blocks));
      grid->readBuffers(stream_);
    } catch (const std::ios_base::failure&) {
      fail(ErrorCode::kFormat, what + " is truncated or damaged: it needs bytes beyond the " +
                                   std::to_string(file_.size()) + " of the file");
    } catch (const std::bad_alloc&) {
      fail(ErrorCode::kFormat, what + " is damaged: it needs more memory than there is");
    }
    const openvdb::Index64 voxels = grid->activeVoxelCount();
    if (voxels > kMaxVoxels) {
      fail(ErrorCode::kMemoryLimit, what + " holds " + std::to_string(voxels) +
                                        " active voxels; at most " + std::to_string(kMaxVoxels) +
                                        " can be read");
    }
    requireAllowed(voxels * kVoxelBytes, kVoxelAllowance, file_.size(), file_.path(),
                   "the " + std::to_string(voxels) + " active voxels of the grid '" + name + "'");
    grid->tree().voxelizeActiveTiles();
    return grid;
  }

 private:
  InputFile file_;
  VolumeHeader header_;
  std::ifstream stream_;
};

/// Copies the leaves of a tree to the places of their bricks; a brick without a leaf stays zero.
template <typename Tree>
void copyLeaves(const Tree& tree, const std::vector<std::array<int32_t, 3>>& bricks, size_t width,
                float* out) {
  parallelFor(bricks.size(), kBricksPerTask, [&](size_t begin, size_t end) {
    for (size_t b = begin; b < end; ++b) {
      float* target = out + b * kVoxels * width;
      std::memset(target, 0, kVoxels * width * sizeof(float));
      const auto* leaf =
          tree.probeConstLeaf(openvdb::Coord(bricks[b][0], bricks[b][1], bricks[b][2]));
      if (leaf == nullptr) continue;
      const auto* values = leaf->buffer().data();
      for (auto on = leaf->cbeginValueOn(); on; ++on) {
        std::memcpy(target + on.pos() * width, &values[on.pos()], width * sizeof(float));
      }
    }
  });
}

struct Frame {
  double voxel_size = 0.0;
  openvdb::Vec3d origin;
};

/// Voxel size and centre of voxel (0,0,0). Errors: kFormat where voxels are not cubes along the
/// axes.
Frame frameOf(const openvdb::math::Transform& transform, const char* path) {
  Frame frame;
  frame.voxel_size = transform.voxelSize().x();
  frame.origin = transform.indexToWorld(openvdb::Vec3d(0, 0, 0));
  bool cubes = transform.isLinear() && frame.voxel_size > 0;
  const double reach = frame.voxel_size + frame.origin.length();
  for (int axis = 0; axis < 3 && cubes; ++axis) {
    openvdb::Vec3d unit(0.0);
    unit[axis] = 1.0;
    const openvdb::Vec3d step = transform.indexToWorld(unit) - frame.origin;
    cubes = (step - unit * frame.voxel_size).length() <=
            kFrameTolerance * frame.voxel_size + 1e-15 * reach;
  }
  if (!cubes) {
    fail(ErrorCode::kFormat,
         std::string(path) + ": the voxels of its grids must be cubes along the axes");
  }
  return frame;
}

void readVolume(const char* path, double* voxel_size, double* origin,
                const StippleMediaSink& sink) {
  CheckedFile file(path);
  const auto density = file.take<openvdb::FloatGrid>(kDensityName);
  const auto colour = file.take<openvdb::Vec3SGrid>(kColourName);
  const Frame frame = frameOf(density->transform(), path);
  const Frame other = frameOf(colour->transform(), path);
  const double largest = std::max({std::abs(frame.origin[0]), std::abs(frame.origin[1]),
                                   std::abs(frame.origin[2]), frame.voxel_size});
  for (int axis = 0; axis < 3; ++axis) {
    if (std::abs(frame.origin[axis] - other.origin[axis]) > kFrameTolerance * largest ||
        std::abs(frame.voxel_size - other.voxel_size) > kFrameTolerance * frame.voxel_size) {
      fail(ErrorCode::kFormat,
           std::string(path) + ": the grids density and color have different transforms");
    }
    origin[axis] = frame.origin[axis];
  }
  *voxel_size = frame.voxel_size;

  std::map<std::array<int32_t, 3>, bool> found;
  const auto collect = [&found](const auto& tree) {
    for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf) {
      const openvdb::Coord at = leaf->origin();
      found[{at.x(), at.y(), at.z()}] = true;
    }
  };
  collect(density->tree());
  collect(colour->tree());
  std::vector<std::array<int32_t, 3>> bricks;
  bricks.reserve(found.size());
  for (const auto& entry : found) bricks.push_back(entry.first);

  give(sink, kMediaBricks, bricks);
  const size_t bytes = bricks.size() * kVoxels * sizeof(float);
  copyLeaves(density->tree(), bricks, 1, static_cast<float*>(allocate(sink, kMediaDensity, bytes)));
  copyLeaves(colour->tree(), bricks, 3,
             static_cast<float*>(allocate(sink, kMediaColour, bytes * 3)));
}

/// OpenVDB takes what is below an isovalue for inside, and a background that is outside closes the
/// surface where the stored voxels end.
openvdb::FloatGrid::Ptr depthGrid(const StippleMediaVolume& volume, float threshold) {
  const auto grid = openvdb::FloatGrid::create(threshold);
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  const auto transform = openvdb::math::Transform::createLinearTransform(volume.voxel_size);
  transform->postTranslate(openvdb::Vec3d(volume.origin[0], volume.origin[1], volume.origin[2]));
  grid->setTransform(transform);
  const size_t count = static_cast<size_t>(volume.brick_count);
  std::vector<FloatLeaf*> leaves(count, nullptr);
  parallelFor(count, kBricksPerTask, [&](size_t begin, size_t end) {
    for (size_t b = begin; b < end; ++b) {
      const int32_t* at = volume.bricks + b * 3;
      leaves[b] = new FloatLeaf(openvdb::Coord(at[0], at[1], at[2]), threshold, true);
      float* values = leaves[b]->buffer().data();
      for (size_t v = 0; v < kVoxels; ++v) values[v] = threshold - volume.density[b * kVoxels + v];
    }
  });
  for (FloatLeaf* leaf : leaves) grid->tree().addLeaf(leaf);
  return grid;
}

void surfaceOf(const StippleMediaVolume& volume, double threshold, double adaptivity,
               const StippleMediaSink& sink) {
  const auto grid = depthGrid(volume, static_cast<float>(threshold));
  openvdb::tools::VolumeToMesh mesher(0.0, adaptivity, false);
  mesher(*grid);
  give(sink, kMediaSurfacePoints,
       std::vector<openvdb::Vec3s>(mesher.pointList().get(),
                                   mesher.pointList().get() + mesher.pointListSize()));
  std::vector<std::array<uint32_t, 4>> faces;
  for (size_t p = 0; p < mesher.polygonPoolListSize(); ++p) {
    const openvdb::tools::PolygonPool& pool = mesher.polygonPoolList()[p];
    for (size_t i = 0; i < pool.numQuads(); ++i) {
      const openvdb::Vec4I& quad = pool.quad(i);
      faces.push_back({quad[0], quad[1], quad[2], quad[3]});
    }
    for (size_t i = 0; i < pool.numTriangles(); ++i) {
      const openvdb::Vec3I& triangle = pool.triangle(i);
      faces.push_back({triangle[0], triangle[1], triangle[2], kMediaNoCorner});
    }
  }
  give(sink, kMediaSurfaceFaces, faces);
}

}  // namespace

void stipple_media_volume_surface(const StippleMediaVolume* volume, double threshold,
                                  double adaptivity, const StippleMediaSink* sink,
                                  StippleMediaStatus* status) {
  guard("the volume's surface", status, [&] {
    initialiseOnce();
    surfaceOf(*volume, threshold, adaptivity, *sink);
  });
}

void stipple_media_volume_write(const char* path, const StippleMediaVolume* volume,
                                StippleMediaStatus* status) {
  guard(path, status, [&] {
    initialiseOnce();
    try {
      writeVolume(path, *volume);
    } catch (const openvdb::IoError& error) {
      fail(ErrorCode::kIo, std::string(path) + " cannot be written: " + error.what());
    }
  });
}

void stipple_media_volume_read(const char* path, double* voxel_size, double* origin,
                               const StippleMediaSink* sink, StippleMediaStatus* status) {
  guard(path, status, [&] {
    initialiseOnce();
    readVolume(path, voxel_size, origin, *sink);
  });
}

}  // namespace stipple::media
