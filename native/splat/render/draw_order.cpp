#include "splat/render/draw_order.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "math/affine.h"
#include "math/colour.h"
#include "splat/cpu/depth_sort.h"
#include "splat/cpu/reused_array.h"
#include "splat/render/scene.h"

namespace stipple {

namespace {

constexpr size_t kRangeSplats = 4096;

struct DrawRow {
  float geometry_row, instance, colour_high, colour_low;
};
static_assert(sizeof(DrawRow) == kDrawRowFloats * sizeof(float));

/// An instance with what depth and colour need; matrices may be singular, unlike a PlacedCloud's.
struct OrderedCloud {
  const SplatCloud* cloud;
  double depth_row[4];  ///< view z = depth_row . (x, y, z, 1)
  double eye[3];        ///< camera's centre in object space; orthographic: viewing direction there
  bool perspective;
  int sh_degree;
  bool to_display;  ///< colours are stored scene linear
  bool is_checked;
  const ColourGrade* grade;  ///< NULL where it leaves colours alone
  float number;
  uint64_t first_row;
  uint64_t first_index;
};

void validatePlacement(const Mat4d& matrix, const std::string& name) {
  for (int i = 0; i < 16; ++i) {
    const double value = matrix(i / 4, i % 4);
    if (!(std::abs(value) <= 1e15)) {
      fail(ErrorCode::kInvalidArgument, name + " holds " + std::to_string(value) +
                                            "; finite values of size 1e15 at most are allowed");
    }
  }
  if (matrix(3, 0) != 0 || matrix(3, 1) != 0 || matrix(3, 2) != 0 || matrix(3, 3) != 1) {
    fail(ErrorCode::kInvalidArgument, name + " has a last row other than 0 0 0 1");
  }
}

bool isInvertible(const Mat3d& linear) {
  const double allowed = linear.col(0).norm() * linear.col(1).norm() * linear.col(2).norm();
  return std::abs(determinant(linear)) > 1e-12 * allowed;
}

OrderedCloud placeForOrder(const SplatInstance& instance, const Camera& camera,
                           int sh_degree_limit) {
  const SplatCloud& cloud = *instance.cloud;
  const Mat3d to_view = linearPart(camera.world_to_camera);
  const Mat3d object = linearPart(instance.object_to_world);
  const Vec3d origin = translationPart(instance.object_to_world);
  // The same products as in a PlacedCloud, so that depths round alike.
  const Mat3d linear = to_view * object;
  const Vec3d translation = to_view * origin + translationPart(camera.world_to_camera);
  OrderedCloud placed = {};
  placed.cloud = &cloud;
  for (int axis = 0; axis < 3; ++axis) placed.depth_row[axis] = linear(2, axis);
  placed.depth_row[3] = translation[2];
  placed.perspective = camera.model == CameraModel::kPerspective;
  placed.sh_degree = std::min(cloud.sh_degree, sh_degree_limit);
  placed.to_display = cloud.colour_space == ColourSpace::kLinear;
  placed.is_checked = instance.values_are_checked;
  placed.grade = instance.grade.changesColour() ? &instance.grade : nullptr;
  if (placed.sh_degree > 0 && !isInvertible(object)) placed.sh_degree = 0;
  if (placed.sh_degree > 0) {
    const Mat3d to_object = inverse(object);
    const Vec3d eye = placed.perspective ? Vec3d(to_object * (cameraCentre(camera) - origin))
                                         : Vec3d(to_object * to_view.row(2).transpose());
    for (int axis = 0; axis < 3; ++axis) placed.eye[axis] = eye[axis];
  }
  return placed;
}

/// 0..65535, finer where eyes are: steps of 2^-15 of the root of the largest colour.
uint32_t colourStep(const OrderedCloud& placed, float sum) {
  float value = std::clamp(sum, 0.0f, kMaxDrawColour);
  if (placed.to_display) value = linearToSrgb(value);
  return static_cast<uint32_t>(std::sqrt(value * (1.0f / kMaxDrawColour)) * 65535.0f + 0.5f);
}

/// The harmonics of splat `index` from the camera, as two exact floats.
void fillColour(const OrderedCloud& placed, size_t index, DrawRow& row) {
  const SplatCloud& cloud = *placed.cloud;
  const float* sh = &cloud.sh[index * cloud.shStride()];
  float basis[25];
  int degree = placed.sh_degree;
  if (degree > 0) {
    double direction[3];
    double squared = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
      direction[axis] =
          placed.perspective
              ? static_cast<double>(cloud.positions[index * 3 + axis]) - placed.eye[axis]
              : placed.eye[axis];
      squared += direction[axis] * direction[axis];
    }
    if (squared > 0) {
      const double inverse = 1.0 / std::sqrt(squared);
      harmonicBasis(degree, static_cast<float>(direction[0] * inverse),
                    static_cast<float>(direction[1] * inverse),
                    static_cast<float>(direction[2] * inverse), basis);
    } else {
      degree = 0;  // the camera sits in the splat, which then has no direction
    }
  }
  float sums[3] = {0.5f + kShC0 * sh[0], 0.5f + kShC0 * sh[1], 0.5f + kShC0 * sh[2]};
  const size_t count = shCoefficientCount(degree);
  for (size_t k = 1; k < count; ++k) {
    for (size_t c = 0; c < 3; ++c) sums[c] += basis[k] * sh[k * 3 + c];
  }
  if (placed.grade) {
    // As finishColour does.
    for (float& sum : sums) sum = std::clamp(sum, -1e12f, 1e12f);
    applyGrade(*placed.grade, sums);
  }
  const uint32_t red = colourStep(placed, sums[0]);
  const uint32_t green = colourStep(placed, sums[1]);
  const uint32_t blue = colourStep(placed, sums[2]);
  row.colour_high = static_cast<float>(red << 8 | green >> 8);
  row.colour_low = static_cast<float>((green & 255u) << 16 | blue);
}

}  // namespace

struct DrawOrderWorkspace::Arrays {
  std::vector<OrderedCloud> clouds;
  ReusedArray<DepthItem> items[2];
  ReusedArray<DrawRow> rows;  ///< by splat
  std::vector<uint32_t> filled;
  std::vector<uint32_t> digits;
};

DrawOrderWorkspace::DrawOrderWorkspace() : arrays_(std::make_unique<Arrays>()) {}
DrawOrderWorkspace::~DrawOrderWorkspace() = default;
DrawOrderWorkspace::DrawOrderWorkspace(DrawOrderWorkspace&&) noexcept = default;
DrawOrderWorkspace& DrawOrderWorkspace::operator=(DrawOrderWorkspace&&) noexcept = default;

uint64_t DrawOrderWorkspace::bytes() const {
  const Arrays& a = *arrays_;
  return a.clouds.capacity() * sizeof(OrderedCloud) + a.items[0].bytes() + a.items[1].bytes() +
         a.rows.bytes() + (a.filled.capacity() + a.digits.capacity()) * sizeof(uint32_t);
}

namespace {

/// Checks everything but the clouds' values. Returns the number of splats.
uint64_t placeInstances(std::span<const SplatInstance> instances, const Camera& camera,
                        const DrawOrderOutput& output, std::vector<OrderedCloud>& clouds) {
  validate(camera);
  requireImagePlane(camera, "the order for a graphics card");
  if (output.sh_degree_limit < 0 || output.sh_degree_limit > kMaxShDegree) {
    fail(ErrorCode::kInvalidArgument,
         "sh_degree_limit is " + std::to_string(output.sh_degree_limit) + "; 0 to 4 is allowed");
  }
  if (output.rows && output.first_rows.size() != instances.size()) {
    fail(ErrorCode::kInvalidArgument, "first_rows has " + std::to_string(output.first_rows.size()) +
                                          " entries; one for each of the " +
                                          std::to_string(instances.size()) +
                                          " instances is allowed");
  }
  clouds.clear();
  uint64_t count = 0;
  for (size_t i = 0; i < instances.size(); ++i) {
    const std::string name = "instance " + std::to_string(i);
    if (!instances[i].cloud) fail(ErrorCode::kInvalidArgument, name + " has no cloud");
    validatePlacement(instances[i].object_to_world, name + ": matrix");
    validateSizes(*instances[i].cloud, name.c_str());
    validate(instances[i].grade, name.c_str());
    OrderedCloud placed = placeForOrder(instances[i], camera, output.sh_degree_limit);
    placed.number = static_cast<float>(i);
    placed.first_index = count;
    if (output.rows) {
      placed.first_row = output.first_rows[i];
      if (placed.first_row > kMaxDrawRows || i > kMaxDrawRows ||
          placed.cloud->size() > kMaxDrawRows - placed.first_row) {
        fail(ErrorCode::kInvalidArgument,
             name + " ends at row " + std::to_string(placed.first_row + placed.cloud->size()) +
                 "; at most " + std::to_string(kMaxDrawRows) + " rows are allowed");
      }
    }
    count += placed.cloud->size();
    if (placed.cloud->size() > 0) clouds.push_back(placed);
  }
  if (count > UINT32_MAX) {
    fail(ErrorCode::kUnsupported, "the view holds " + std::to_string(count) +
                                      " splats; at most 4294967295 can be ordered together");
  }
  return count;
}

/// Depth, and with rows the colour, of splats [first, last) of one cloud.
void fillItems(const OrderedCloud& placed, size_t first, size_t last, DepthItem* items,
               DrawRow* rows) {
  const double* m = placed.depth_row;
  const float* p = placed.cloud->positions.data();
  for (size_t i = first; i < last; ++i) {
    const double depth = m[0] * static_cast<double>(p[i * 3]) +
                         m[1] * static_cast<double>(p[i * 3 + 1]) +
                         m[2] * static_cast<double>(p[i * 3 + 2]) + m[3];
    const size_t index = placed.first_index + i;
    items[index] = depthItem(depth, index);
  }
  if (!rows) return;
  for (size_t i = first; i < last; ++i) {
    DrawRow& row = rows[placed.first_index + i];
    row.geometry_row = static_cast<float>(placed.first_row + i);
    row.instance = placed.number;
    fillColour(placed, i, row);
  }
}

}  // namespace

void orderForDrawing(std::span<const SplatInstance> instances, const Camera& camera,
                     const DrawOrderOutput& output, DrawOrderWorkspace& workspace,
                     Progress* progress) {
  DrawOrderWorkspace::Arrays& arrays = workspace.arrays();
  const size_t count = placeInstances(instances, camera, output, arrays.clouds);
  if (count == 0) return;
  DepthItem* items = arrays.items[0].resize(count);
  arrays.items[1].resize(count);
  DrawRow* rows = output.rows ? arrays.rows.resize(count) : nullptr;
  arrays.filled.resize(rangeCount(count, kRangeSplats));
  arrays.digits.resize(kDepthSortDigits);
  const auto fill = [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    arrays.filled[begin / kRangeSplats] = static_cast<uint32_t>(end - begin);
    const auto after = std::upper_bound(
        arrays.clouds.begin(), arrays.clouds.end(), begin,
        [](size_t value, const OrderedCloud& placed) { return value < placed.first_index; });
    for (auto placed = after - 1; begin < end; ++placed) {
      const size_t first = begin - placed->first_index;
      const size_t last = std::min<size_t>(end - placed->first_index, placed->cloud->size());
      if (!placed->is_checked && !rowsAreValid(*placed->cloud, first, last)) {
        const std::string name = "instance " + std::to_string(static_cast<size_t>(placed->number));
        validate(*placed->cloud, name.c_str());
        fail(ErrorCode::kInvalidArgument, name + " changed while it was being ordered");
      }
      fillItems(*placed, first, last, items, rows);
      begin = placed->first_index + last;
    }
  };
  parallelFor(count, kRangeSplats, std::cref(fill));
  const DepthItem* sorted = sortByDepth(
      {{items, arrays.items[1].get()}, arrays.filled, kRangeSplats, count, arrays.digits.data()});
  if (progress) progress->throwIfCancelled();
  DrawRow* out = reinterpret_cast<DrawRow*>(output.rows);
  const auto emit = [&](size_t begin, size_t end) {
    constexpr size_t kAhead = 16;
    for (size_t i = begin; i < end; ++i) {
      const uint32_t splat = static_cast<uint32_t>(sorted[count - 1 - i]);
      if (output.order) output.order[i] = splat;
      if (!out) continue;
      __builtin_prefetch(
          &rows[static_cast<uint32_t>(sorted[count - 1 - std::min(i + kAhead, end - 1)])]);
      out[i] = rows[splat];
    }
  };
  parallelFor(count, kRangeSplats, std::cref(emit));
}

void validateDrawOrder(std::span<const SplatInstance> instances, const Camera& camera,
                       const DrawOrderOutput& output) {
  std::vector<OrderedCloud> clouds;
  placeInstances(instances, camera, output, clouds);
}

uint64_t drawOrderMemoryBound(uint64_t splat_count) {
  const uint64_t arrays = splat_count * (2 * sizeof(DepthItem) + sizeof(DrawRow));
  // Arrays on huge pages, 8 MiB at least, are rounded up to 2 MiB.
  return arrays + std::min(arrays / 4, 3 * (uint64_t{2} << 20)) +
         (rangeCount(splat_count, kRangeSplats) + kDepthSortDigits) * sizeof(uint32_t);
}

void packDrawGeometry(const SplatCloud& cloud, float* geometry) {
  const auto pack = [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float* out = geometry + i * kDrawGeometryFloats;
      std::copy_n(&cloud.positions[i * 3], 3, out);
      out[3] = cloud.opacities[i];
      std::copy_n(&cloud.rotations[i * 4], 4, out + 4);
      std::copy_n(&cloud.scales[i * 3], 3, out + 8);
      out[11] = 0.0f;
    }
  };
  parallelFor(cloud.size(), kRangeSplats, std::cref(pack));
}

}  // namespace stipple
