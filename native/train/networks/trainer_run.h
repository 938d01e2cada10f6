#pragma once

#include <memory>

#include "nn/network_run.h"
#include "train/networks/gradient_exchange.h"

namespace stipple {

/// How a trainer works.
struct TrainerRun {
  std::shared_ptr<GradientExchange> exchange;  ///< with the other processes; null: there are none
  /// Of the factors of products in blocks of networks. Weights, their derivatives, moments and all
  /// sums are float32 either way.
  FactorPrecision precision = FactorPrecision::kFloat32;
};

}  // namespace stipple
