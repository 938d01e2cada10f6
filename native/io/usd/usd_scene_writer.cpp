// Based on: OpenUSD documentation, "Scenegraph Instancing": prims that are instanceable and refer
// to the same prim share what lies below it.
#include "io/usd/usd_scene_writer.h"

#include <Eigen/LU>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>
#include <vector>

#include "base/error.h"
#include "data/clouds/sh_degree.h"
#include "io/bytes/quoted_text.h"
#include "io/splats/splat_file.h"
#include "io/usd/usd_file.h"
#include "io/usd/usd_layer_text.h"
#include "io/usd/usd_names.h"

namespace stipple {

namespace {

constexpr char kStage[] = "Writing splats";

bool isSame(const SplatCloud& a, const SplatCloud& b) {
  return &a == &b ||
         (a.sh_degree == b.sh_degree && a.positions == b.positions && a.rotations == b.rotations &&
          a.scales == b.scales && a.opacities == b.opacities && a.sh == b.sh);
}

/// Names of prims: letters, digits and underscores of ASCII, none twice.
class PrimNames {
 public:
  std::string nameFor(const std::string& wanted) {
    std::string base;
    for (const char c : wanted) {
      const bool is_kept =
          (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
      // Of a letter of several bytes one underscore stays.
      if (is_kept)
        base += c;
      else if ((static_cast<unsigned char>(c) & 0xC0) != 0x80)
        base += '_';
    }
    if (base.empty() || (base.front() >= '0' && base.front() <= '9'))
      base.insert(base.begin(), '_');
    std::string name = base;
    for (size_t number = 1; !taken_.insert(name).second; ++number) {
      name = base + "_" + std::to_string(number);
    }
    return name;
  }

 private:
  std::set<std::string> taken_;
};

/// The shortest decimals that read back as the same numbers. USD multiplies rows by matrices.
std::string matrixText(const Mat4d& matrix) {
  std::string text = "(";
  for (int row = 0; row < 4; ++row) {
    text += row > 0 ? ", (" : " (";
    for (int column = 0; column < 4; ++column) {
      char digits[32];
      const auto end = std::to_chars(digits, digits + sizeof(digits), matrix(column, row)).ptr;
      text += (column > 0 ? ", " : "") + std::string(digits, end);
    }
    text += ')';
  }
  return text + " )";
}

/// The change of axes between two frames, as a matrix.
Mat4d changeOfFrame(Frame from, Frame to) {
  const FrameConversion conversion(from, to);
  Mat4d matrix = Mat4d::Identity();
  for (int axis = 0; axis < 3; ++axis) {
    float place[3] = {0, 0, 0};
    place[axis] = 1;
    float rotation[4] = {1, 0, 0, 0}, scale[3] = {1, 1, 1}, sh[3] = {0, 0, 0};
    conversion.apply(place, rotation, scale, 0, sh);
    for (int row = 0; row < 3; ++row) matrix(row, axis) = static_cast<double>(place[row]);
  }
  return matrix;
}

/// Splats that are written once.
struct Shared {
  const SplatCloud* cloud;
  std::vector<size_t> objects;  ///< that show them
  std::string prim;             ///< of those that several show
};

class SceneWriter {
 public:
  SceneWriter(std::span<const UsdObject> objects, Frame frame, const std::string& path,
              const SplatWriteOptions& options, Progress* progress)
      : objects_(objects), path_(path), options_(options), progress_(progress), file_(path) {
    scene_frame_ = options.frame == Frame::kUnknown ? kUsdFrame : options.frame;
    to_scene_ = changeOfFrame(frame, scene_frame_);
    share();
  }

  void write() {
    put(usdMetadata(scene_frame_, "Scene", "") + "\ndef Xform \"Scene\"\n{\n");
    std::vector<std::string> names(objects_.size());
    PrimNames taken;
    for (size_t i = 0; i < objects_.size(); ++i) names[i] = taken.nameFor(objects_[i].name);
    PrimNames roots;
    roots.nameFor("Scene");
    for (Shared& shared : shared_) {
      if (shared.objects.size() > 1) {
        shared.prim = roots.nameFor(objects_[shared.objects.front()].name + "_splats");
      }
    }
    for (size_t i = 0; i < objects_.size(); ++i) putObject(i, names[i]);
    put("}\n");
    for (const Shared& shared : shared_) {
      if (shared.prim.empty()) continue;
      put("\nclass Xform \"" + shared.prim + "\"\n{\n");
      putSplats(*shared.cloud);
      put("}\n");
    }
    file_.commit();
  }

 private:
  void put(const std::string& text) { file_.put(text); }

  void share() {
    double rows = 0;
    for (size_t i = 0; i < objects_.size(); ++i) {
      const auto found = std::find_if(shared_.begin(), shared_.end(), [&](const Shared& shared) {
        return isSame(*shared.cloud, *objects_[i].cloud);
      });
      if (found == shared_.end()) {
        shared_.push_back({objects_[i].cloud, {i}, {}});
        rows += static_cast<double>(objects_[i].cloud->size());
      } else {
        found->objects.push_back(i);
      }
    }
    all_rows_ = rows * static_cast<double>(usdArrays(0, false).size());
  }

  void putObject(size_t index, const std::string& name) {
    const UsdObject& object = objects_[index];
    const auto found = std::find_if(shared_.begin(), shared_.end(), [&](const Shared& shared) {
      return std::find(shared.objects.begin(), shared.objects.end(), index) != shared.objects.end();
    });
    std::string metadata;
    if (name != object.name && !object.name.empty()) {
      metadata += "    displayName = " + quotedText(object.name) + "\n";
    }
    if (!found->prim.empty()) {
      metadata += "    instanceable = true\n    prepend references = </" + found->prim + ">\n";
    }
    put("def Xform \"" + name + "\"" + (metadata.empty() ? "" : " (\n" + metadata + ")") +
        "\n{\n    matrix4d xformOp:transform = " + matrixText(to_scene_ * object.matrix) +
        "\n    uniform token[] xformOpOrder = [\"xformOp:transform\"]\n");
    if (found->prim.empty()) putSplats(*found->cloud);
    put("}\n");
  }

  void putSplats(const SplatCloud& cloud) {
    SplatCloud like;
    const SplatCloud* written = &cloud;
    if (cloud.sh_degree > options_.sh_degree_limit) {
      cut_ = withShDegree(cloud, options_.sh_degree_limit);
      written = &cut_;
    }
    if (options_.half) requireHalves(*written, path_);
    like.sh_degree = written->sh_degree;
    like.colour_space = cloud.colour_space;
    like.antialias = cloud.antialias;
    like.frame = scene_frame_;
    const UsdSink sink = [this](const std::string& text) { put(text); };
    put(usdPrimHead(like, "Splats") + "    float3[] extent = " + usdExtent(*written) + "\n");
    for (const UsdArray& array : usdArrays(written->sh_degree, options_.half)) {
      put(std::string("    ") + array.type + " " + array.name + " = [\n");
      putUsdRows(array, *written, sink, [this](size_t rows) {
        done_ += static_cast<double>(rows);
        advance(progress_, done_ / all_rows_, kStage);
      });
      put("    ]\n");
    }
    put("}\n");
    cut_ = SplatCloud();
  }

  std::span<const UsdObject> objects_;
  std::string path_;
  SplatWriteOptions options_;
  Progress* progress_;
  UsdFile file_;
  Frame scene_frame_ = kUsdFrame;
  Mat4d to_scene_ = Mat4d::Identity();
  std::vector<Shared> shared_;
  SplatCloud cut_;  ///< of the splats that are being written, where harmonics are left out
  double all_rows_ = 0, done_ = 0;
};

void requireObjects(std::span<const UsdObject> objects, const std::string& path) {
  const SplatFormat* format = splatFormatOfExtension(path);
  if (format == nullptr || !format->holds_times) {
    fail(ErrorCode::kUnsupported,
         path + " cannot hold objects of their own; .usda, .usd and .usdz can");
  }
  if (objects.empty()) {
    fail(ErrorCode::kInvalidArgument, "there are no objects to write; at least one is needed");
  }
  for (const UsdObject& object : objects) {
    const std::string what = "object '" + object.name + "'";
    validate(*object.cloud, what.c_str());
    if (object.cloud->size() == 0) {
      fail(ErrorCode::kUnsupported, path + " cannot be written: " + what +
                                        " has no splats, and a prim of splats needs at least one");
    }
    const SplatCloud& first = *objects.front().cloud;
    if (object.cloud->colour_space != first.colour_space ||
        object.cloud->antialias != first.antialias) {
      fail(ErrorCode::kUnsupported, what +
                                        " has another colour space or low-pass filter than those "
                                        "before it; one of each is needed");
    }
    const Mat4d& matrix = object.matrix;
    const double volume = matrix.topLeftCorner<3, 3>().determinant();
    if (!matrix.allFinite() || matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1) || volume == 0 ||
        !std::isfinite(volume)) {
      fail(ErrorCode::kInvalidArgument,
           what + " has a matrix that is singular or not affine; splats cannot be placed by it");
    }
  }
}

}  // namespace

void writeUsdScene(std::span<const UsdObject> objects, Frame frame, const std::string& path,
                   const SplatWriteOptions& options, Progress* progress) {
  requireObjects(objects, path);
  SceneWriter(objects, frame, path, options, progress).write();
}

}  // namespace stipple
