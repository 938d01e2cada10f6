#include "nn/mlp.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"

namespace stipple {
namespace {

std::vector<float> numbers(size_t count, uint64_t seed) {
  std::vector<float> out(count);
  for (size_t i = 0; i < count; ++i) {
    out[i] = 2.0f * unitFloat(keyedBits(seed, RandomUse::kNetworkStart, i)) - 1.0f;
  }
  return out;
}

Mlp smallNetwork() {
  const size_t widths[] = {5, 9, 7, 3};
  Mlp network(widths, 11);
  for (LinearLayer& layer : network.layers()) layer.biases = numbers(layer.outputs, 12);
  return network;
}

/// The same network in double.
std::vector<double> outputInDouble(const std::vector<LinearLayer>& layers,
                                   const std::vector<double>& input) {
  std::vector<double> values = input;
  for (size_t l = 0; l < layers.size(); ++l) {
    const LinearLayer& layer = layers[l];
    std::vector<double> next(layer.outputs);
    for (size_t o = 0; o < layer.outputs; ++o) {
      next[o] = static_cast<double>(layer.biases[o]);
      for (size_t i = 0; i < layer.inputs; ++i) {
        next[o] += values[i] * static_cast<double>(layer.weights[i * layer.outputs + o]);
      }
      if (l + 1 < layers.size()) next[o] /= 1.0 + std::exp(-next[o]);
    }
    values = next;
  }
  return values;
}

/// sum of factor times output, over the batch, in double.
double lossInDouble(const std::vector<LinearLayer>& layers, const std::vector<float>& input,
                    const std::vector<float>& factors) {
  const size_t in = layers.front().inputs;
  const size_t out = layers.back().outputs;
  double loss = 0;
  for (size_t row = 0; row < input.size() / in; ++row) {
    const auto from = input.begin() + static_cast<long>(row * in);
    const std::vector<double> output =
        outputInDouble(layers, std::vector<double>(from, from + static_cast<long>(in)));
    for (size_t o = 0; o < out; ++o) {
      loss += static_cast<double>(factors[row * out + o]) * output[o];
    }
  }
  return loss;
}

TEST(Mlp, GivesWhatTheFormulaGives) {
  const Mlp network = smallNetwork();
  const std::vector<float> input = numbers(4 * 5, 13);
  MlpTape tape;
  network.forward(input, 4, tape);
  for (size_t row = 0; row < 4; ++row) {
    const auto from = input.begin() + static_cast<long>(row * 5);
    const std::vector<double> expected =
        outputInDouble(network.layers(), std::vector<double>(from, from + 5));
    for (size_t o = 0; o < 3; ++o) {
      // Three layers of float32 sums of at most nine terms of size 1.
      EXPECT_NEAR(static_cast<double>(tape.output()[row * 3 + o]), expected[o], 3e-6);
    }
  }
}

TEST(Mlp, GradientsAreThoseOfDifferencesInDouble) {
  const Mlp network = smallNetwork();
  const std::vector<float> input = numbers(6 * 5, 14);
  const std::vector<float> factors = numbers(6 * 3, 15);
  MlpTape tape;
  network.forward(input, 6, tape);
  std::vector<LinearLayer> gradients = network.zeros();
  std::vector<float> input_gradient(input.size());
  network.backward(input, tape, factors, gradients, input_gradient);
  // Central differences in double: truncation about 1e-7 of the gradient at this step, which is a
  // power of two so that float32 holds the moved weight exactly enough. Float32 gradients are sums
  // of at most 54 terms of size 1.
  const double eps = 0x1.0p-10;
  const double tolerance = 2e-5;
  std::vector<LinearLayer> moved = network.layers();
  const auto difference = [&](float& value) {
    const float kept = value;
    value = kept + static_cast<float>(eps);
    const double above = static_cast<double>(value);
    const double high = lossInDouble(moved, input, factors);
    value = kept - static_cast<float>(eps);
    const double below = static_cast<double>(value);
    const double low = lossInDouble(moved, input, factors);
    value = kept;
    return (high - low) / (above - below);
  };
  for (size_t l = 0; l < moved.size(); ++l) {
    for (size_t i = 0; i < moved[l].weights.size(); ++i) {
      EXPECT_NEAR(static_cast<double>(gradients[l].weights[i]), difference(moved[l].weights[i]),
                  tolerance)
          << "weight " << i << " of layer " << l;
    }
    for (size_t i = 0; i < moved[l].biases.size(); ++i) {
      EXPECT_NEAR(static_cast<double>(gradients[l].biases[i]), difference(moved[l].biases[i]),
                  tolerance)
          << "bias " << i << " of layer " << l;
    }
  }
  std::vector<float> moved_input = input;
  for (size_t i = 0; i < input.size(); ++i) {
    const float kept = moved_input[i];
    moved_input[i] = kept + static_cast<float>(eps);
    const double above = static_cast<double>(moved_input[i]);
    const double high = lossInDouble(moved, moved_input, factors);
    moved_input[i] = kept - static_cast<float>(eps);
    const double below = static_cast<double>(moved_input[i]);
    const double low = lossInDouble(moved, moved_input, factors);
    moved_input[i] = kept;
    EXPECT_NEAR(static_cast<double>(input_gradient[i]), (high - low) / (above - below), tolerance);
  }
}

TEST(Mlp, HasTheSameBitsForAnyNumberOfThreads) {
  const size_t widths[] = {53, 64, 120};
  const Mlp network(widths, 16);
  const std::vector<float> input = numbers(513 * 53, 17);
  const std::vector<float> factors = numbers(513 * 120, 18);
  std::vector<float> first_output, first_gradient;
  std::vector<float> first_input_gradient;
  for (const unsigned threads : {1u, 3u}) {
    MlpTape tape;
    std::vector<LinearLayer> gradients = network.zeros();
    std::vector<float> input_gradient(input.size());
    withThreads(threads, [&] {
      network.forward(input, 513, tape);
      network.backward(input, tape, factors, gradients, input_gradient);
    });
    const std::vector<float> output(tape.output().begin(), tape.output().end());
    if (first_output.empty()) {
      first_output = output;
      first_gradient = gradients[0].weights;
      first_input_gradient = input_gradient;
    }
    EXPECT_EQ(output, first_output);
    EXPECT_EQ(gradients[0].weights, first_gradient);
    EXPECT_EQ(input_gradient, first_input_gradient);
  }
}

TEST(Mlp, TakesAnEmptyBatch) {
  const Mlp network = smallNetwork();
  MlpTape tape;
  network.forward({}, 0, tape);
  std::vector<LinearLayer> gradients = network.zeros();
  gradients[0].weights[0] = 5.0f;
  network.backward({}, tape, {}, gradients, {});
  EXPECT_EQ(tape.output().size(), 0u);
  EXPECT_EQ(gradients[0].weights[0], 0.0f);
}

TEST(Mlp, RefusesLayersThatDoNotFitTogether) {
  const auto messageOf = [](std::vector<LinearLayer> layers) -> std::string {
    try {
      Mlp network(std::move(layers));
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kFormat);
      return error.what();
    }
    return "";
  };
  std::vector<LinearLayer> layers = smallNetwork().layers();
  EXPECT_EQ(messageOf(layers), "");
  layers[1].weights.pop_back();
  EXPECT_THAT(messageOf(layers), ::testing::HasSubstr("layer 1 of the network has 62 weights"));
  layers = smallNetwork().layers();
  layers.erase(layers.begin() + 1);
  EXPECT_THAT(messageOf(layers), ::testing::HasSubstr("takes 7 numbers; the layer before gives 9"));
  EXPECT_THAT(messageOf({}), ::testing::HasSubstr("0 layers"));
}

}  // namespace
}  // namespace stipple
