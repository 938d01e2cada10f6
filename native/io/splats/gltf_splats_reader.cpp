#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "data/clouds/cloud_transform.h"
#include "data/clouds/splat_frame.h"
#include "io/bytes/input_file.h"
#include "io/bytes/limits.h"
#include "io/media_library.h"
#include "io/splats/cloud_parts.h"
#include "io/splats/gltf_splat_names.h"
#include "io/splats/gltf_splats.h"
#include "io/splats/splat_check.h"
#include "io/splats/spz_file.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 4096;
// The JSON of a real splat file is a few kilobytes; a mesh file's may be longer.
constexpr uint64_t kLookedAtBytes = uint64_t{1} << 26;
constexpr size_t kGlbHead = 20;
constexpr char kGlbMagic[] = "glTF";

/// What the media library delivers, part by part.
struct Delivery {
  std::vector<StippleMediaSplatPart> infos;
  std::vector<SplatCloud> clouds;
  std::vector<ByteVector> packed;  ///< of the parts that are packed

  void* take(uint32_t array, uint64_t bytes) {
    if (array == kMediaSplatParts) {
      infos.resize(static_cast<size_t>(bytes / sizeof(StippleMediaSplatPart)));
      clouds.resize(infos.size());
      packed.resize(infos.size());
      return infos.data();
    }
    const size_t part = (array - kMediaSplatPositions) / 5;
    if (infos.at(part).packing == kMediaSplatsInSpz) {
      packed[part].resize(static_cast<size_t>(bytes));
      return packed[part].data();
    }
    SplatCloud& cloud = clouds[part];
    if (cloud.size() == 0) {
      // All at once, on pages that all threads touch.
      cloud.sh_degree = static_cast<int>(infos[part].sh_degree);
      cloud.resize(static_cast<size_t>(infos[part].count));
    }
    std::vector<float>* const arrays[] = {&cloud.positions, &cloud.rotations, &cloud.scales,
                                          &cloud.opacities, &cloud.sh};
    std::vector<float>& values = *arrays[(array - kMediaSplatPositions) % 5];
    values.resize(static_cast<size_t>(bytes / sizeof(float)));
    return values.data();
  }
};

/// x, y, z, w to w, x, y, z of length 1; zeros stay for validate() to find.
void finishRotations(SplatCloud& cloud) {
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float* q = &cloud.rotations[i * 4];
      std::rotate(q, q + 3, q + 4);
      double squares = 0;
      for (int k = 0; k < 4; ++k) squares += double(q[k]) * double(q[k]);
      // A unit quaternion up to rounding stays as it is, bit for bit.
      if (std::abs(squares - 1.0) < 1e-6 || !(squares > 0)) continue;
      const double length = std::sqrt(squares);
      for (int k = 0; k < 4; ++k) q[k] = static_cast<float>(double(q[k]) / length);
    }
  });
}

/// The splats of an SPZ file inside of a glTF file, in glTF's frame. In: what, the part in
/// messages.
SplatCloud unpacked(ByteVector bytes, const StippleMediaSplatPart& info, const std::string& what) {
  SplatCloud cloud = readSpzBytes(std::move(bytes), what, nullptr);
  if (info.count != UINT64_MAX && info.count != cloud.size()) {
    fail(ErrorCode::kFormat, what + " has accessors of " + std::to_string(info.count) +
                                 " elements; its SPZ data holds " + std::to_string(cloud.size()) +
                                 " splats");
  }
  // As the SPZ library turns it: the file has its own frame, the scene glTF's.
  convertFrame(cloud, kGltfFrame);
  if (cloud.antialias == Antialias::kClassic) {
    cloud.antialias = static_cast<Antialias>(info.antialias);
  }
  return cloud;
}

/// The part in the file's scene. In: what, the part in messages.
SplatCloud placed(SplatCloud cloud, const StippleMediaSplatPart& info, const std::string& what) {
  cloud.colour_space = static_cast<ColourSpace>(info.colour_space);
  cloud.frame = static_cast<Frame>(info.frame);
  const Mat4d matrix = Eigen::Map<const Mat4d>(info.matrix);
  try {
    validate(cloud, "part");
    return matrix == Mat4d::Identity() ? std::move(cloud) : transformed(cloud, matrix);
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, what + ": " + error.what());
  }
}

}  // namespace

bool startsAsGltfSplats(const SplatFileStart& start) {
  const bool binary = start.bytes.rfind(kGlbMagic, 0) == 0;
  if (start.is_folder || (!binary && lowerExtension(start.path) != ".gltf")) return false;
  const InputFile file(start.path);
  uint64_t json = file.size();
  if (binary && start.bytes.size() >= kGlbHead) {
    uint32_t length = 0;
    std::memcpy(&length, start.bytes.data() + 12, sizeof(length));
    json = std::min<uint64_t>(json, kGlbHead + uint64_t{length});
  }
  std::string text(static_cast<size_t>(std::min(json, kLookedAtBytes)), '\0');
  file.readAt(0, text.data(), text.size());
  return text.find(std::string(1, '"') + kGltfSplats + '"') != text.npos;
}

SplatCloud readGltfSplats(const std::string& path, Progress* progress) {
  // Names a missing or unreadable file in the words of every reader.
  const uint64_t file_bytes = InputFile(path).size();
  if (file_bytes == 0) fail(ErrorCode::kFormat, path + " is empty");
  Delivery delivery;
  const MediaSink sink(
      [&delivery](uint32_t array, uint64_t bytes) { return delivery.take(array, bytes); });
  const StippleMediaTable& media = mediaTable();
  callMedia([&](StippleMediaStatus* status) {
    media.gltf_splats_read(path.c_str(), sink.get(), status);
  });
  advance(progress, 0.5, "Reading splats");
  // The packed parts may lie in a file beside it.
  uint64_t packed_bytes = file_bytes;
  for (const ByteVector& packed : delivery.packed) {
    packed_bytes = std::max<uint64_t>(packed_bytes, packed.size());
  }
  std::vector<SplatCloud> parts;
  uint64_t bytes = 0;
  for (size_t p = 0; p < delivery.clouds.size(); ++p) {
    const StippleMediaSplatPart& info = delivery.infos[p];
    const std::string what = path + ": mesh " + std::to_string(info.mesh) + ", primitive " +
                             std::to_string(info.primitive);
    SplatCloud& cloud = delivery.clouds[p];
    if (info.packing == kMediaSplatsInSpz) {
      cloud = unpacked(std::move(delivery.packed[p]), info, what);
      bytes += cloudBytes(cloud.size(), cloud.sh_degree);
      requireAllowed(bytes, kSplatAllowance, packed_bytes, path, "the splats of its SPZ parts");
    } else {
      cloud.sh_degree = static_cast<int>(info.sh_degree);
      cloud.antialias = static_cast<Antialias>(info.antialias);
      finishRotations(cloud);
    }
    parts.push_back(placed(std::move(cloud), info, what));
    const SplatCloud& first = parts.front();
    const SplatCloud& part = parts.back();
    if (part.colour_space != first.colour_space || part.antialias != first.antialias ||
        part.frame != first.frame) {
      fail(ErrorCode::kUnsupported, path +
                                        " holds splats of several colour spaces, low-pass "
                                        "filters or frames; one of each is needed");
    }
  }
  advance(progress, 0.9, "Reading splats");
  if (parts.size() == 1) return std::move(parts.front());
  return joined(parts);
}

}  // namespace stipple
