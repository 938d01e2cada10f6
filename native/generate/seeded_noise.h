#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// Where the normal numbers of a generation come from.
enum class NoiseSource {
  /// Each number has a key of its own: seed, stream, index. A shorter stream is the beginning of a
  /// longer one, and the bits are the same on every machine with IEEE 754 arithmetic.
  kKeyed,
  /// What PyTorch draws on a CPU in float32 from one generator of this seed, stream after stream:
  /// to repeat somebody's run. PyTorch's own vectorised functions differ in the last bits.
  kTorchCpu,
};

struct NoiseSeed {
  NoiseSource source = NoiseSource::kKeyed;
  /// Any number; kTorchCpu uses its lower 32 bits, as PyTorch does.
  uint64_t seed = 42;
};

/// How many numbers each stream has, in the order in which kTorchCpu draws them.
struct NoiseSizes {
  uint64_t colour = 0;  ///< of the VAE: latent channels * (S / 8)^2
  uint64_t tokens = 0;  ///< of the latent: token count * width
  uint64_t camera = 5;
};

/// Numbers of the standard normal distribution.
struct GenerationNoise {
  std::vector<float> colour, tokens, camera;
};

/// All that is random in the way from an image to a latent, from one seed.
/// Threads and determinism: kKeyed in parallel, kTorchCpu on one thread; same bits for any number
/// of threads. Cost: about 30 ns for a number.
GenerationNoise drawNoise(const NoiseSizes& sizes, const NoiseSeed& seed);

/// sqrt(-2 ln(1 - u)) cos(2 pi v) from nothing but sums, products, quotients and square roots of
/// doubles, so that every machine gets the same bits; an error of at most 2e-15 relative to the
/// radius. In: u, v in [0, 1), multiples of 2^-53.
double portableNormal(double u, double v);

}  // namespace stipple
