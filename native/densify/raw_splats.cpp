#include "densify/raw_splats.h"

#include <algorithm>
#include <cmath>

namespace stipple {

void RawSplats::resize(size_t count) {
  extras.resize(extra_lengths.size());
  for (size_t i = 0; i < arrayCount(*this); ++i) {
    const RawArray array = static_cast<RawArray>(i);
    arrayOf(*this, array).resize(count * rowLength(*this, array));
  }
}

const std::vector<float>& arrayOf(const RawSplats& splats, RawArray array) {
  switch (array) {
    case RawArray::kPositions:
      return splats.positions;
    case RawArray::kRotations:
      return splats.rotations;
    case RawArray::kLogScales:
      return splats.log_scales;
    case RawArray::kLogits:
      return splats.logits;
    case RawArray::kSh:
      return splats.sh;
  }
  return splats.extras[static_cast<size_t>(array) - kRawArrayCount];
}

std::vector<float>& arrayOf(RawSplats& splats, RawArray array) {
  return const_cast<std::vector<float>&>(arrayOf(static_cast<const RawSplats&>(splats), array));
}

size_t rowLength(const RawSplats& splats, RawArray array) {
  constexpr size_t kLengths[] = {3, 4, 3, 1};
  if (array == RawArray::kSh) return splats.shStride();
  const size_t index = static_cast<size_t>(array);
  return index < kRawArrayCount ? kLengths[index] : splats.extra_lengths[index - kRawArrayCount];
}

RawSplats zerosLike(const RawSplats& splats) {
  RawSplats zeros;
  zeros.sh_degree = splats.sh_degree;
  zeros.colour_space = splats.colour_space;
  zeros.antialias = splats.antialias;
  zeros.extra_lengths = splats.extra_lengths;
  zeros.resize(splats.size());
  return zeros;
}

RawSplats rowsOf(const RawSplats& splats, const std::vector<uint32_t>& rows) {
  RawSplats chosen;
  chosen.sh_degree = splats.sh_degree;
  chosen.colour_space = splats.colour_space;
  chosen.antialias = splats.antialias;
  chosen.extra_lengths = splats.extra_lengths;
  chosen.resize(rows.size());
  for (size_t i = 0; i < arrayCount(splats); ++i) {
    const RawArray array = static_cast<RawArray>(i);
    const size_t length = rowLength(splats, array);
    const float* from = arrayOf(splats, array).data();
    float* to = arrayOf(chosen, array).data();
    for (size_t k = 0; k < rows.size(); ++k) {
      std::copy_n(from + rows[k] * length, length, to + k * length);
    }
  }
  return chosen;
}

float activatedScale(float log_scale) {
  return std::exp(std::min(log_scale, kLargestLogScale));
}

float activatedOpacity(float logit) {
  // The exponential of a number that is not positive: it cannot overflow.
  const float small = std::exp(-std::abs(logit));
  return logit >= 0 ? 1.0f / (1.0f + small) : small / (1.0f + small);
}

float rawScale(float scale) {
  return std::log(std::max(scale, kLeastRawScale));
}

float rawOpacity(float opacity) {
  const double held =
      std::clamp(static_cast<double>(opacity), static_cast<double>(kLeastRawOpacity),
                 1.0 - static_cast<double>(kLeastRawOpacity));
  return static_cast<float>(std::log(held) - std::log1p(-held));
}

RawSplats rawSplats(const SplatCloud& cloud) {
  RawSplats raw;
  raw.sh_degree = cloud.sh_degree;
  raw.colour_space = cloud.colour_space;
  raw.antialias = cloud.antialias;
  raw.positions = cloud.positions;
  raw.rotations = cloud.rotations;
  raw.sh = cloud.sh;
  raw.log_scales.resize(cloud.scales.size());
  std::transform(cloud.scales.begin(), cloud.scales.end(), raw.log_scales.begin(), rawScale);
  raw.logits.resize(cloud.opacities.size());
  std::transform(cloud.opacities.begin(), cloud.opacities.end(), raw.logits.begin(), rawOpacity);
  return raw;
}

SplatCloud activated(const RawSplats& splats) {
  SplatCloud cloud;
  cloud.sh_degree = splats.sh_degree;
  cloud.colour_space = splats.colour_space;
  cloud.antialias = splats.antialias;
  cloud.positions = splats.positions;
  cloud.rotations = splats.rotations;
  cloud.sh = splats.sh;
  cloud.scales.resize(splats.log_scales.size());
  std::transform(splats.log_scales.begin(), splats.log_scales.end(), cloud.scales.begin(),
                 activatedScale);
  cloud.opacities.resize(splats.logits.size());
  std::transform(splats.logits.begin(), splats.logits.end(), cloud.opacities.begin(),
                 activatedOpacity);
  return cloud;
}

}  // namespace stipple
