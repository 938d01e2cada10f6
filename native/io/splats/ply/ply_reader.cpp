// Based on: Kerbl et al., 3D Gaussian Splatting for Real-Time Radiance Field Rendering, SIGGRAPH
// 2023 (the attributes and their activations), and Yu et al., Mip-Splatting, CVPR 2024, eq. 7 (the
// 3D smoothing filter that a property filter_3D asks for).
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "io/bytes/input_file.h"
#include "io/splats/ply/ply_comments.h"
#include "io/splats/ply/ply_file.h"
#include "io/splats/ply/ply_header.h"
#include "io/splats/ply/ply_rows.h"
#include "io/splats/quantize.h"

namespace stipple {

namespace {

// Rows that one task reads and decodes: a quarter of a megabyte at degree 3, which stays in cache.
constexpr size_t kBlockRows = 1024;
constexpr size_t kNoColumn = std::numeric_limits<size_t>::max();
// A 2DGS splat has two scales; the third axis is made this much shorter than the shorter of them.
constexpr float kFlatness = 1e-3f;

/// One property and where its values go: destination[row * stride].
struct Target {
  size_t property = kNoColumn;
  float* destination = nullptr;
  size_t stride = 0;
};

struct Bad {
  size_t row = kNoColumn;
  std::string what;
};

class Reader {
 public:
  Reader(const std::string& path, Progress* progress)
      : file_(path), progress_(progress), header_(readPlyHeader(file_)), rows_(file_, header_) {}

  SplatCloud read() {
    findVertices();
    readComments();
    mapProperties();
    readRows();
    return std::move(cloud_);
  }

 private:
  [[noreturn]] void failHere(ErrorCode code, const std::string& what) const {
    fail(code, file_.path() + " " + what);
  }

  /// Goes to the rows of the element 'vertex'.
  void findVertices() {
    for (const PlyElement& element : header_.elements) {
      if (element.name == "chunk") {
        failHere(
            ErrorCode::kUnsupported,
            "has an element 'chunk' after 4096 bytes of header; a compressed PLY names it before");
      }
    }
    for (const PlyElement& element : header_.elements) {
      if (element.name == "vertex") {
        vertices_ = &element;
        return;
      }
      rows_.skip(element);
    }
    failHere(ErrorCode::kFormat, "has no element 'vertex'; a splat file has one vertex per splat");
  }

  void readComments() {
    const bool has_mode = readPlyComments(header_.comments, file_.path(), cloud_);
    // Mip-Splatting's trainer writes filter_3D and no comment.
    if (!has_mode && find("filter_3D")) cloud_.antialias = Antialias::kMip;
  }

  std::optional<size_t> find(const std::string& name) const {
    for (size_t p = 0; p < vertices_->properties.size(); ++p) {
      const PlyProperty& property = vertices_->properties[p];
      if (property.name == name && !property.is_list) return p;
    }
    return std::nullopt;
  }

  size_t require(const std::string& name) const {
    if (const std::optional<size_t> property = find(name)) return *property;
    if (find("f_anchor_feat_0")) {
      failHere(ErrorCode::kUnsupported,
               "holds Scaffold-GS anchors, which are splats only together with a network");
    }
    failHere(ErrorCode::kFormat, "has no vertex property '" + name +
                                     "'; x y z f_dc_0..2 opacity scale_0..1 rot_0..3 are needed");
  }

  /// Degree of the harmonics from the number of f_rest properties.
  int degree() const {
    size_t count = 0;
    for (const PlyProperty& property : vertices_->properties) {
      if (property.name.rfind("f_rest_", 0) == 0 && !property.is_list) ++count;
    }
    for (int d = 0; d <= kMaxShDegree; ++d) {
      if (count == (shCoefficientCount(d) - 1) * 3) return d;
    }
    failHere(ErrorCode::kFormat, "has " + std::to_string(count) +
                                     " properties f_rest_*; 0, 9, 24, 45 or 72 make whole bands");
  }

  void mapProperties() {
    cloud_.sh_degree = degree();
    const size_t coefficients = shCoefficientCount(cloud_.sh_degree);
    const size_t rest = coefficients - 1;
    for (const char* name : {"x", "y", "z"}) require(name);
    for (const char* name : {"f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "rot_0",
                             "rot_1", "rot_2", "rot_3"}) {
      require(name);
    }
    for (size_t i = 0; i < rest * 3; ++i) require("f_rest_" + std::to_string(i));
    if (vertices_->count > std::numeric_limits<size_t>::max() / (cloud_.shStride() * 8)) {
      failHere(ErrorCode::kMemoryLimit, "holds more splats than this machine can address");
    }
    cloud_.resize(static_cast<size_t>(vertices_->count));

    const char* kAxes[] = {"x", "y", "z"};
    for (size_t i = 0; i < 3; ++i) map(kAxes[i], cloud_.positions, i, 3);
    for (size_t i = 0; i < 3; ++i)
      map("f_dc_" + std::to_string(i), cloud_.sh, i, cloud_.shStride());
    // The file holds all of red, then all of green, then all of blue.
    for (size_t i = 0; i < rest * 3; ++i) {
      map("f_rest_" + std::to_string(i), cloud_.sh, (1 + i % rest) * 3 + i / rest,
          cloud_.shStride());
    }
    map("opacity", cloud_.opacities, 0, 1);
    flat_ = !find("scale_2");
    for (size_t i = 0; i < (flat_ ? 2 : 3); ++i) {
      map("scale_" + std::to_string(i), cloud_.scales, i, 3);
    }
    for (size_t i = 0; i < 4; ++i) map("rot_" + std::to_string(i), cloud_.rotations, i, 4);
    if (find("filter_3D")) {
      filters_.resize(cloud_.size());
      map("filter_3D", filters_, 0, 1);
    }
  }

  void map(const std::string& name, std::vector<float>& array, size_t first, size_t stride) {
    // An empty array has no address to add to; without rows none is used either.
    targets_.push_back({require(name), array.empty() ? nullptr : array.data() + first, stride});
  }

  void readRows() {
    const size_t count = cloud_.size();
    const PlyRowLayout layout = rows_.layout(*vertices_);
    bad_.resize(rangeCount(count, kBlockRows));
    if (header_.encoding != PlyEncoding::kAscii && !vertices_->hasList()) {
      const uint64_t data = rows_.offset();
      parallelFor(count, kBlockRows, [&](size_t begin, size_t end) {
        const size_t bytes = (end - begin) * layout.stride;
        const auto block = std::make_unique_for_overwrite<char[]>(bytes);
        file_.readAt(data + begin * uint64_t{layout.stride}, block.get(), bytes);
        decode(layout, block.get(), begin, end);
      });
    } else {
      std::vector<char> block(std::min(count, kBlockRows) * layout.stride);
      for (size_t begin = 0; begin < count; begin += kBlockRows) {
        const size_t end = std::min(count, begin + kBlockRows);
        rows_.read(*vertices_, layout, end - begin, block.data());
        decode(layout, block.data(), begin, end);
      }
    }
    for (const Bad& bad : bad_) {
      if (bad.row != kNoColumn) failHere(ErrorCode::kFormat, bad.what);
    }
  }

  /// Block [begin, end) of packed rows → activated attributes.
  void decode(const PlyRowLayout& layout, const char* block, size_t begin, size_t end) {
    Bad bad;
    for (const Target& target : targets_) {
      float* out = target.destination + begin * target.stride;
      extractPlyColumn(block, layout.stride, end - begin, layout.columns[target.property], out,
                       target.stride);
      for (size_t row = begin; row < std::min(end, bad.row); ++row) {
        const float value = target.destination[row * target.stride];
        if (std::isfinite(value)) continue;
        bad = {row, "holds " + numberText(static_cast<double>(value)) + " in property '" +
                        vertices_->properties[target.property].name + "' of vertex " +
                        std::to_string(row) + "; every value must be a finite float32 number"};
      }
    }
    if (bad.row == kNoColumn) activate(begin, end, &bad);
    bad_[begin / kBlockRows] = bad;
    const size_t done = rows_done_.fetch_add(end - begin) + (end - begin);
    advance(progress_, static_cast<double>(done) / static_cast<double>(cloud_.size()),
            "Reading splats");
  }

  void activate(size_t begin, size_t end, Bad* bad) {
    const size_t stored_axes = flat_ ? 2 : 3;
    for (size_t i = begin; i < end; ++i) {
      cloud_.opacities[i] =
          static_cast<float>(1.0 / (1.0 + std::exp(-static_cast<double>(cloud_.opacities[i]))));
      float* scale = &cloud_.scales[i * 3];
      for (size_t axis = 0; axis < stored_axes; ++axis) {
        const float logarithm = scale[axis];
        const double deviation = std::exp(static_cast<double>(logarithm));
        if (deviation <= static_cast<double>(std::numeric_limits<float>::max())) {
          scale[axis] = static_cast<float>(deviation);
          continue;
        }
        *bad = {i, "holds " + numberText(static_cast<double>(logarithm)) + " in property 'scale_" +
                       std::to_string(axis) + "' of vertex " + std::to_string(i) +
                       "; it is a logarithm, and 88.7 is the largest that float32 can undo"};
        return;
      }
      if (flat_) scale[2] = kFlatness * std::min(scale[0], scale[1]);
      normaliseRotation(&cloud_.rotations[i * 4]);
      if (!filters_.empty()) smooth(i);
    }
  }

  /// Variances grow by filter_3D squared, the peak falls so that the integral stays.
  void smooth(size_t i) {
    const double variance = double(filters_[i]) * double(filters_[i]);
    double ratio = 1.0;
    for (size_t axis = 0; axis < 3; ++axis) {
      float& scale = cloud_.scales[i * 3 + axis];
      const double before = double(scale) * double(scale);
      const double after = before + variance;
      if (after > 0.0) ratio *= before / after;
      scale =
          static_cast<float>(std::min(std::sqrt(after), double(std::numeric_limits<float>::max())));
    }
    cloud_.opacities[i] = static_cast<float>(double(cloud_.opacities[i]) * std::sqrt(ratio));
  }

  InputFile file_;
  Progress* progress_;
  PlyHeader header_;
  PlyRowReader rows_;
  const PlyElement* vertices_ = nullptr;
  SplatCloud cloud_;
  std::vector<Target> targets_;
  std::vector<float> filters_;
  std::vector<Bad> bad_;
  std::atomic<size_t> rows_done_{0};
  bool flat_ = false;
};

}  // namespace

SplatCloud readPlySplats(const std::string& path, Progress* progress) {
  return Reader(path, progress).read();
}

}  // namespace stipple
