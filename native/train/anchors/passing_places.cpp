#include "train/anchors/passing_places.h"

#include <Eigen/Dense>
#include <algorithm>
#include <memory>

#include "decode/anchors/scaffold_decoder.h"
#include "train/anchors/scaffold_steps.h"
#include "train/prior/point_lives.h"
#include "train/prior/start_splats.h"

namespace stipple {

namespace {

/// They are asked about at 48 times: more would cost memory and tell little.
constexpr uint64_t kMostPlaces = 100000;

/// Splats of an anchor that begins have the tanh of this for opacity, at least.
constexpr double kFaint = 0.1;

}  // namespace

std::vector<float> PassingPlaces::between(double from, double to) const {
  std::vector<float> places;
  for (size_t i = 0; i < size(); ++i) {
    if (spans[i * 2] > to || spans[i * 2 + 1] < from) continue;
    places.insert(places.end(), &positions[i * 3], &positions[i * 3] + 3);
  }
  return places;
}

PassingPlaces passingPlaces(const ViewSource& views, std::span<const size_t> training,
                            uint64_t seed, Progress* progress) {
  PassingPlaces passing;
  if (views.points().times.empty()) return passing;
  StartOptions options;
  options.max_count = kMostPlaces;
  options.with_lives = true;
  options.sh_degree = 0;
  options.seed = seed;
  const StartSplats start = startSplats(views, training, options, progress);
  for (size_t i = 0; i < start.times.size(); ++i) {
    const double before = static_cast<double>(start.lives[i * 2]);
    const double behind = static_cast<double>(start.lives[i * 2 + 1]);
    const bool is_known = before >= 0 && behind >= 0;
    const double whole = static_cast<double>(kWholeLife);
    if (!is_known || (before >= whole && behind >= whole)) continue;
    passing.positions.insert(passing.positions.end(), &start.splats.positions[i * 3],
                             &start.splats.positions[i * 3] + 3);
    passing.spans.push_back(start.times[i] - before);
    passing.spans.push_back(start.times[i] + behind);
  }
  return passing;
}

std::vector<uint32_t> allButFaintest(const ScaffoldParameters& scaffold, size_t dropped) {
  ScaffoldTape tape;
  SplatCloud cloud;
  // The scaffold outlives the decoder: nothing owns it here.
  const std::shared_ptr<const ScaffoldParameters> shared(std::shared_ptr<void>(), &scaffold);
  ScaffoldDecoder(shared).forward(scaffold, scaffold.size(), tape, cloud);
  std::vector<double> opacities(scaffold.size(), 0.0);
  for (size_t n = 0; n < tape.slots.size(); ++n) {
    opacities[tape.slots[n] / scaffold.gaussians] += static_cast<double>(cloud.opacities[n]);
  }
  std::vector<uint32_t> rows = orderOfWorth(opacities);
  rows.resize(rows.size() - std::min(dropped, rows.size()));
  std::sort(rows.begin(), rows.end());
  return rows;
}

std::vector<float> faintFeatures(const Mlp& opacity) {
  constexpr int kMostRounds = 50;
  const auto count = static_cast<Eigen::Index>(opacity.outputWidth());
  std::vector<float> features(kScaffoldFeatures, 0.0f);
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Rows input(count, Eigen::Index{kScaffoldFeatures}), by_features = input;
  const Rows each_alone = Rows::Identity(count, count);
  const auto numbersOf = [](auto& rows) {
    return std::span(rows.data(), static_cast<size_t>(rows.size()));
  };
  std::vector<LinearLayer> unused = opacity.zeros();
  MlpTape tape;
  for (int round = 0; round < kMostRounds; ++round) {
    const Eigen::Map<const Eigen::RowVectorXf> at(features.data(), Eigen::Index{kScaffoldFeatures});
    input.rowwise() = at;
    opacity.forward(numbersOf(input), static_cast<size_t>(count), tape);
    const Eigen::VectorXd seen =
        Eigen::Map<const Eigen::VectorXf>(tape.output().data(), count).cast<double>();
    const Eigen::VectorXd missing = (kFaint - seen.array()).cwiseMax(0.0);
    if (!(missing.maxCoeff() > 0.01 * kFaint)) break;
    // The shortest step that would do if the network were linear, held back where it hardly is.
    opacity.backward(numbersOf(input), tape, numbersOf(each_alone), unused, numbersOf(by_features));
    const Eigen::MatrixXd jacobian = by_features.cast<double>();
    Eigen::MatrixXd normal = jacobian * jacobian.transpose();
    normal.diagonal().array() += 1e-3 * normal.trace() / static_cast<double>(count) + 1e-9;
    const Eigen::VectorXd step = jacobian.transpose() * normal.ldlt().solve(missing);
    if (!step.allFinite()) break;
    for (size_t i = 0; i < kScaffoldFeatures; ++i) {
      features[i] += static_cast<float>(step[static_cast<Eigen::Index>(i)]);
    }
  }
  return features;
}

}  // namespace stipple
