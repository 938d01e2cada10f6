#include "splat/edit/cloud_merge.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "data/clouds/cloud_transform.h"
#include "data/clouds/cloud_bytes.h"

namespace stipple {

namespace {

const char* nameOf(ColourSpace space) {
  return space == ColourSpace::kLinear ? "lin_rec709_display" : "srgb_rec709_display";
}

const char* nameOf(Antialias antialias) {
  return antialias == Antialias::kMip ? "mip" : "classic";
}

/// In: what, as a noun; i: the first cloud that differs from cloud 0.
[[noreturn]] void refuse(const char* what, size_t i, const char* seen, const char* first) {
  fail(ErrorCode::kUnsupported, std::string("cloud ") + std::to_string(i) + " has the " + what +
                                    " " + seen + " and cloud 0 has " + first +
                                    "; merged clouds must agree");
}

void requireAgreement(std::span<const SplatInstance> instances) {
  for (size_t i = 0; i < instances.size(); ++i) {
    if (!instances[i].cloud) {
      fail(ErrorCode::kInvalidArgument, "cloud " + std::to_string(i) + " is missing");
    }
    const SplatCloud& first = *instances[0].cloud;
    const SplatCloud& cloud = *instances[i].cloud;
    if (cloud.colour_space != first.colour_space) {
      refuse("colour space", i, nameOf(cloud.colour_space), nameOf(first.colour_space));
    }
    if (cloud.antialias != first.antialias) {
      refuse("antialias flag", i, nameOf(cloud.antialias), nameOf(first.antialias));
    }
  }
}

int highestDegree(std::span<const SplatInstance> instances) {
  int degree = 0;
  for (const SplatInstance& instance : instances) {
    degree = std::max(degree, instance.cloud->sh_degree);
  }
  return degree;
}

void append(const SplatCloud& cloud, SplatCloud& result) {
  const auto join = [](const std::vector<float>& from, std::vector<float>& to) {
    to.insert(to.end(), from.begin(), from.end());
  };
  join(cloud.positions, result.positions);
  join(cloud.rotations, result.rotations);
  join(cloud.scales, result.scales);
  join(cloud.opacities, result.opacities);
  const size_t from = cloud.shStride();
  const size_t to = result.shStride();
  const size_t before = result.sh.size();
  result.sh.resize(before + cloud.size() * to);  // new values are 0
  for (size_t i = 0; i < cloud.size(); ++i) {
    std::copy_n(cloud.sh.begin() + static_cast<std::ptrdiff_t>(i * from), from,
                result.sh.begin() + static_cast<std::ptrdiff_t>(before + i * to));
  }
}

}  // namespace

SplatCloud merged(std::span<const SplatInstance> instances, Frame frame) {
  SplatCloud result;
  result.frame = frame;
  if (instances.empty()) return result;
  requireAgreement(instances);
  result.sh_degree = highestDegree(instances);
  result.colour_space = instances[0].cloud->colour_space;
  result.antialias = instances[0].cloud->antialias;
  size_t count = 0;
  for (const SplatInstance& instance : instances) count += instance.cloud->size();
  result.positions.reserve(count * 3);
  result.rotations.reserve(count * 4);
  result.scales.reserve(count * 3);
  result.opacities.reserve(count);
  result.sh.reserve(count * result.shStride());
  for (size_t i = 0; i < instances.size(); ++i) {
    const SplatInstance& instance = instances[i];
    const bool stays = instance.object_to_world == Mat4d::Identity();
    if (stays) validate(*instance.cloud, ("cloud " + std::to_string(i)).c_str());
    if (stays && instance.grade.isNeutral()) {
      append(*instance.cloud, result);
      continue;
    }
    SplatCloud moved =
        stays ? *instance.cloud : transformed(*instance.cloud, instance.object_to_world);
    bakeGrade(moved, instance.grade);
    append(moved, result);
  }
  return result;
}

uint64_t mergeMemoryBound(std::span<const SplatInstance> instances) {
  const int degree = highestDegree(instances);
  uint64_t total = 0;
  uint64_t largest = 0;
  for (const SplatInstance& instance : instances) {
    total += cloudBytes(instance.cloud->size(), degree);
    largest = std::max(largest, cloudBytes(instance.cloud->size(), instance.cloud->sh_degree));
  }
  return total + largest;
}

}  // namespace stipple
