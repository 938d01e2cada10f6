// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355), its encoder.
#include "train/networks/trained_encoder.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "decode/latent/token_layers.h"
#include "nn/norms.h"
#include "nn/positions.h"
#include "nn/training/norms_backward.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 4096;

/// Tokens look at rows as wide as themselves, whatever the latent is.
NetworkShape insideOf(NetworkShape shape) {
  shape.latent_width = shape.width();
  return shape;
}

}  // namespace

TrainedEncoder::TrainedEncoder(ParameterLayout& layout, const std::string& prefix,
                               const NetworkShape& shape, std::span<const size_t> feature_widths)
    : width_(shape.width()),
      embedding_(layout, prefix, width_),
      blocks_(layout, prefix, insideOf(shape), feature_widths.size()),
      mean_(layout, prefix + "mean_out", width_, shape.latent_width),
      log_variance_(layout, prefix + "logvar_out", width_, shape.latent_width) {
  for (size_t i = 0; i < feature_widths.size(); ++i) {
    const std::string name = prefix + (i == 0 ? "cond_pcd_proj" : "cond_pcd_proj2");
    features_.emplace_back(layout, name, feature_widths[i], width_);
  }
}

std::vector<ContextRows> TrainedEncoder::contextsOf(std::span<const FeaturePoints> points,
                                                    const Tape& tape) const {
  std::vector<ContextRows> contexts;
  for (size_t i = 0; i < features_.size(); ++i) {
    contexts.push_back({points[i].count, tape.rows[i].data()});
  }
  return contexts;
}

EncodedLatent TrainedEncoder::forward(std::span<const float> values,
                                      std::span<const FeaturePoints> points,
                                      std::span<const uint32_t> queries, Tape& tape) const {
  const size_t count = queries.size();
  tape.queries.clear();
  for (const uint32_t query : queries) {
    const float* from = points[0].points + size_t{query} * 3;
    tape.queries.insert(tape.queries.end(), from, from + 3);
  }
  for (size_t i = 0; i < features_.size(); ++i) {
    tape.rows[i].resize(points[i].count * width_);
    features_[i].apply(values, points[i].count, points[i].features, tape.rows[i].data());
    addPositions(PositionEncoding::kGeometric, points[i].count, width_, points[i].points,
                 tape.rows[i].data());
  }
  std::vector<float> tokens(count * width_);
  embedding_.apply(values, count, tape.queries.data(), tokens.data());
  const std::vector<float>& last =
      blocks_.apply(values, contextsOf(points, tape), std::move(tokens), tape.blocks);
  tape.normal.resize(last.size());
  layerNorm(lastTokenNorm(width_), count, last.data(), tape.normal.data());
  EncodedLatent made;
  made.mean.resize(count * mean_.outputs());
  made.log_variance.resize(made.mean.size());
  mean_.apply(values, count, tape.normal.data(), made.mean.data());
  log_variance_.apply(values, count, tape.normal.data(), made.log_variance.data());
  return made;
}

void TrainedEncoder::backward(std::span<const float> values, std::span<const FeaturePoints> points,
                              Tape& tape, const EncodedLatent& by, std::span<float> gradients,
                              std::span<float* const> by_features) const {
  const size_t count = tape.queries.size() / 3;
  std::vector<float> by_normal(count * width_), by_variance(count * width_);
  mean_.backward(values, count, tape.normal.data(), by.mean.data(), gradients, by_normal.data());
  log_variance_.backward(values, count, tape.normal.data(), by.log_variance.data(), gradients,
                         by_variance.data());
  for (size_t i = 0; i < by_normal.size(); ++i) by_normal[i] += by_variance[i];
  std::vector<float> by_tokens(count * width_, 0.0f);
  layerNormBackward(lastTokenNorm(width_), count, tape.blocks.tokens.back().data(),
                    by_normal.data(), {}, by_tokens.data());
  std::vector<std::vector<float>> by_rows;
  std::vector<float*> row_gradients;
  for (const FeaturePoints& of : points) by_rows.emplace_back(of.count * width_, 0.0f);
  for (std::vector<float>& rows : by_rows) row_gradients.push_back(rows.data());
  blocks_.backward(values, contextsOf(points, tape), tape.blocks, by_tokens, gradients,
                   row_gradients);
  for (size_t i = 0; i < features_.size(); ++i) {
    features_[i].backward(values, points[i].count, points[i].features, by_rows[i].data(), gradients,
                          by_features[i]);
  }
  embedding_.backward(values, count, tape.queries.data(), by_tokens.data(), gradients);
}

std::vector<uint32_t> farthestPoints(std::span<const float> points, size_t wanted) {
  const size_t count = points.size() / 3;
  if (count == 0 || wanted > count) {
    fail(ErrorCode::kInvalidArgument, "there are " + std::to_string(count) + " points; " +
                                          std::to_string(std::max<size_t>(wanted, 1)) +
                                          " are needed");
  }
  std::vector<float> nearest(count, std::numeric_limits<float>::infinity());
  std::vector<uint32_t> taken;
  std::vector<uint32_t> farthest(rangeCount(count, kGrain));
  for (uint32_t next = 0; taken.size() < wanted;) {
    taken.push_back(next);
    nearest[next] = -1;  // Nor is it taken again where all others lie in taken places.
    const float* from = &points[size_t{next} * 3];
    parallelFor(count, kGrain, [&](size_t begin, size_t end) {
      uint32_t most = static_cast<uint32_t>(begin);
      for (size_t i = begin; i < end; ++i) {
        float squared = 0;
        for (size_t axis = 0; axis < 3; ++axis) {
          const float offset = points[i * 3 + axis] - from[axis];
          squared += offset * offset;
        }
        nearest[i] = std::min(nearest[i], squared);
        if (nearest[i] > nearest[most]) most = static_cast<uint32_t>(i);
      }
      farthest[begin / kGrain] = most;
    });
    next = farthest.front();
    for (const uint32_t other : farthest) {
      if (nearest[other] > nearest[next]) next = other;
    }
  }
  return taken;
}

std::vector<float> drawLatent(const EncodedLatent& encoded, std::span<const float> noise) {
  std::vector<float> made(encoded.mean);
  for (size_t i = 0; i < made.size(); ++i) {
    made[i] += std::exp(0.5f * encoded.log_variance[i]) * noise[i];
  }
  return made;
}

void drawLatentBackward(const EncodedLatent& encoded, std::span<const float> noise,
                        std::span<const float> by_latent, EncodedLatent& by) {
  for (size_t i = 0; i < by_latent.size(); ++i) {
    by.mean[i] += by_latent[i];
    by.log_variance[i] += 0.5f * by_latent[i] * noise[i] * std::exp(0.5f * encoded.log_variance[i]);
  }
}

}  // namespace stipple
