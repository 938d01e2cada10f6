// Based on: Nam et al., Generative Densification, CVPR 2025: attention of points to views. Differs:
// a point's own numbers stand for the features of a backbone, and what it finds is added to them.
#include "train/detail/detail_input.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "nn/activations.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 32;
constexpr double kFar = std::numeric_limits<double>::infinity();

double dot(const float* a, const float* b, size_t width) {
  double sum = 0;
  for (size_t i = 0; i < width; ++i) sum += static_cast<double>(a[i]) * static_cast<double>(b[i]);
  return sum;
}

}  // namespace

DetailInput::DetailInput(ParameterLayout& layout, const std::string& prefix, size_t heads,
                         size_t head_width)
    : heads_(heads),
      head_width_(head_width),
      width_(heads * head_width),
      own_(layout, prefix + "own.0", prefix + "own.2", {kOwnWidth, width_, width_},
           Activation::kGeluErf),
      seen_(layout, prefix + "seen.0", prefix + "seen.2", {kSeenWidth, width_, width_},
            Activation::kGeluErf),
      query_(layout, prefix + "query", width_, width_),
      key_(layout, prefix + "key", width_, width_),
      value_(layout, prefix + "value", width_, width_),
      out_(layout, prefix + "out", width_, width_) {}

std::vector<float> DetailInput::forward(std::span<const float> values,
                                        const CoarseEvidence& evidence, Tape& tape) const {
  const size_t points = evidence.points.size(), views = evidence.views, rows = points * views;
  tape.own.resize(points * width_);
  own_.apply(values, points, evidence.own.data(), tape.own_mlp, tape.own.data());
  tape.seen.resize(rows * width_);
  seen_.apply(values, rows, evidence.seen.data(), tape.seen_mlp, tape.seen.data());
  tape.query.resize(points * width_);
  query_.apply(values, points, tape.own.data(), tape.query.data());
  tape.keys.resize(rows * width_);
  key_.apply(values, rows, tape.seen.data(), tape.keys.data());
  tape.values.resize(rows * width_);
  value_.apply(values, rows, tape.seen.data(), tape.values.data());
  tape.shares.assign(points * heads_ * views, 0.0f);
  tape.found.assign(points * width_, 0.0f);
  const double scale = 1 / std::sqrt(static_cast<double>(head_width_));
  parallelFor(points, kGrain, [&](size_t begin, size_t end) {
    std::vector<double> weights(views);
    for (size_t i = begin * heads_; i < end * heads_; ++i) {
      const size_t point = i / heads_, at = i % heads_ * head_width_;
      double peak = -kFar, sum = 0;
      for (size_t v = 0; v < views; ++v) {
        const size_t row = point * views + v;
        weights[v] = evidence.shows[row] == 0
                         ? -kFar
                         : scale * dot(&tape.query[point * width_ + at],
                                       &tape.keys[row * width_ + at], head_width_);
        peak = std::max(peak, weights[v]);
      }
      if (peak == -kFar) continue;  // No view shows it: it finds nothing.
      for (double& weight : weights) sum += weight = std::exp(weight - peak);
      for (size_t v = 0; v < views; ++v) {
        const auto share = static_cast<float>(weights[v] / sum);
        tape.shares[i * views + v] = share;
        const float* const from = &tape.values[(point * views + v) * width_ + at];
        for (size_t c = 0; c < head_width_; ++c)
          tape.found[point * width_ + at + c] += share * from[c];
      }
    }
  });
  std::vector<float> features(points * width_);
  out_.apply(values, points, tape.found.data(), features.data());
  for (size_t i = 0; i < features.size(); ++i) features[i] += tape.own[i];
  return features;
}

void DetailInput::backward(std::span<const float> values, const CoarseEvidence& evidence,
                           const Tape& tape, std::span<const float> by_features,
                           std::span<float> gradients) const {
  const size_t points = evidence.points.size(), views = evidence.views, rows = points * views;
  std::vector<float> by_found(points * width_);
  out_.backward(values, points, tape.found.data(), by_features.data(), gradients, by_found.data());
  std::vector<float> by_query(points * width_, 0.0f), by_keys(rows * width_, 0.0f);
  std::vector<float> by_values(rows * width_, 0.0f);
  const double scale = 1 / std::sqrt(static_cast<double>(head_width_));
  parallelFor(points, kGrain, [&](size_t begin, size_t end) {
    std::vector<double> by_share(views);
    for (size_t i = begin * heads_; i < end * heads_; ++i) {
      const size_t point = i / heads_, at = i % heads_ * head_width_;
      const float* const outer = &by_found[point * width_ + at];
      double mean = 0;
      for (size_t v = 0; v < views; ++v) {
        const size_t row = (point * views + v) * width_ + at;
        by_share[v] = dot(outer, &tape.values[row], head_width_);
        mean += by_share[v] * static_cast<double>(tape.shares[i * views + v]);
      }
      for (size_t v = 0; v < views; ++v) {
        const size_t row = (point * views + v) * width_ + at;
        const float share = tape.shares[i * views + v];
        const auto by_score =
            static_cast<float>(scale * static_cast<double>(share) * (by_share[v] - mean));
        for (size_t c = 0; c < head_width_; ++c) {
          by_values[row + c] += share * outer[c];
          by_keys[row + c] += by_score * tape.query[point * width_ + at + c];
          by_query[point * width_ + at + c] += by_score * tape.keys[row + c];
        }
      }
    }
  });
  std::vector<float> by_seen(rows * width_), more(rows * width_);
  key_.backward(values, rows, tape.seen.data(), by_keys.data(), gradients, by_seen.data());
  value_.backward(values, rows, tape.seen.data(), by_values.data(), gradients, more.data());
  for (size_t i = 0; i < by_seen.size(); ++i) by_seen[i] += more[i];
  std::vector<float> by_input(rows * kSeenWidth);
  seen_.backward(values, rows, evidence.seen.data(), tape.seen_mlp, by_seen.data(), gradients,
                 by_input.data());
  std::vector<float> by_own(points * width_);
  query_.backward(values, points, tape.own.data(), by_query.data(), gradients, by_own.data());
  for (size_t i = 0; i < by_own.size(); ++i) by_own[i] += by_features[i];
  by_input.resize(points * kOwnWidth);
  own_.backward(values, points, evidence.own.data(), tape.own_mlp, by_own.data(), gradients,
                by_input.data());
}

}  // namespace stipple
