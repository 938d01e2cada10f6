// Based on: Box, Muller, A Note on the Generation of Random Normal Deviates, Annals of Mathematical
// Statistics 1958; Matsumoto, Nishimura, Mersenne Twister, ACM TOMACS 1998. The blocks of sixteen
// and the use of doubles for short streams follow what PyTorch's CPU generator is observed to give.
#include "generate/seeded_noise.h"

#include <cmath>
#include <random>

#include "base/parallel.h"
#include "base/random.h"

namespace stipple {

namespace {

constexpr double kTwoPi = 6.283185307179586;
constexpr size_t kGrain = 4096;

/// ln x for x in (0, 1], from the series of 2 atanh((m - 1) / (m + 1)).
double portableLog(double x) {
  constexpr double kLn2 = 0.6931471805599453;
  int exponent = 0;
  double m = std::frexp(x, &exponent);  // exact, in [0.5, 1)
  if (m < 0.7071067811865476) {
    m *= 2;
    exponent -= 1;
  }
  const double s = (m - 1) / (m + 1);  // |s| < 0.1716, s^2 < 0.0295
  const double s2 = s * s;
  double sum = 0;
  for (int k = 21; k >= 1; k -= 2) sum = sum * s2 + 1.0 / k;  // next term: s^22 / 23 < 1e-18
  return static_cast<double>(exponent) * kLn2 + 2 * s * sum;
}

/// cos(2 pi v) for v in [0, 1), by the eighth of a turn that v is in and a Taylor series.
double portableCosTurn(double v) {
  const double eighths = v * 8;
  const int octant = static_cast<int>(eighths) + 1;
  const int quarter = (octant / 2) & 3;         // nearest quarter of a turn
  const double rest = v - 0.25 * (octant / 2);  // exact, in [-1/8, 1/8]
  const double a = kTwoPi * rest;
  const double a2 = a * a;
  double cosine = 1;
  double sine = 1;
  for (int k = 18; k >= 2; k -= 2) {  // next term: (pi / 4)^20 / 20! < 1e-20
    cosine = 1 - a2 / (k * (k - 1)) * cosine;
    sine = 1 - a2 / (k * (k + 1)) * sine;
  }
  sine *= a;
  switch (quarter) {
    case 0:
      return cosine;
    case 1:
      return -sine;
    case 2:
      return -cosine;
    default:
      return sine;
  }
}

void fillKeyed(uint64_t seed, RandomUse use, std::span<float> out) {
  parallelFor(out.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const double u = unitDouble(keyedBits(seed, use, 2 * i));
      const double v = unitDouble(keyedBits(seed, use, 2 * i + 1));
      out[i] = static_cast<float>(portableNormal(u, v));
    }
  });
}

/// A stream of at least this many numbers is drawn in blocks of as many.
constexpr size_t kTorchBlock = 16;

void drawTorchUniforms(std::mt19937& bits, std::span<float> out) {
  for (float& value : out) value = static_cast<float>(bits() & 0xffffffu) * 0x1.0p-24f;
}

/// Sixteen uniform numbers become normal ones: number j with number j + 8.
void transformTorchBlock(float* block) {
  for (size_t j = 0; j < kTorchBlock / 2; ++j) {
    const double radius = std::sqrt(-2 * std::log1p(-static_cast<double>(block[j])));
    const double angle = kTwoPi * static_cast<double>(block[j + kTorchBlock / 2]);
    block[j] = static_cast<float>(radius * std::cos(angle));
    block[j + kTorchBlock / 2] = static_cast<float>(radius * std::sin(angle));
  }
}

double torchUnitDouble(std::mt19937& bits) {
  const uint64_t high = bits();
  const uint64_t low = bits();
  return static_cast<double>(((high << 32) | low) & ((uint64_t{1} << 53) - 1)) * 0x1.0p-53;
}

void fillTorch(std::mt19937& bits, std::span<float> out) {
  if (out.size() < kTorchBlock) {
    for (size_t i = 0; i < out.size(); i += 2) {
      const double u1 = torchUnitDouble(bits);
      const double u2 = torchUnitDouble(bits);
      const double radius = std::sqrt(-2 * std::log1p(-u2));
      out[i] = static_cast<float>(radius * std::cos(kTwoPi * u1));
      if (i + 1 < out.size()) out[i + 1] = static_cast<float>(radius * std::sin(kTwoPi * u1));
    }
    return;
  }
  // All uniform numbers come first, then each block is transformed; a rest that is shorter than a
  // block is covered by sixteen new numbers that overwrite the end.
  drawTorchUniforms(bits, out);
  for (size_t i = 0; i + kTorchBlock <= out.size(); i += kTorchBlock) {
    transformTorchBlock(out.data() + i);
  }
  if (out.size() % kTorchBlock != 0) {
    const std::span<float> last = out.subspan(out.size() - kTorchBlock);
    drawTorchUniforms(bits, last);
    transformTorchBlock(last.data());
  }
}

}  // namespace

double portableNormal(double u, double v) {
  return std::sqrt(-2 * portableLog(1 - u)) * portableCosTurn(v);
}

GenerationNoise drawNoise(const NoiseSizes& sizes, const NoiseSeed& seed) {
  GenerationNoise noise;
  noise.colour.resize(sizes.colour);
  noise.tokens.resize(sizes.tokens);
  noise.camera.resize(sizes.camera);
  if (seed.source == NoiseSource::kKeyed) {
    fillKeyed(seed.seed, RandomUse::kColourNoise, noise.colour);
    fillKeyed(seed.seed, RandomUse::kTokenNoise, noise.tokens);
    fillKeyed(seed.seed, RandomUse::kCameraNoise, noise.camera);
    return noise;
  }
  std::mt19937 bits(static_cast<uint32_t>(seed.seed));
  fillTorch(bits, noise.colour);
  fillTorch(bits, noise.tokens);
  fillTorch(bits, noise.camera);
  return noise;
}

}  // namespace stipple
