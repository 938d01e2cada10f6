// Fits fields to data sets of make_objects.py and says how good they are at every budget, beside
// explicit splats of as many iterations and their cuts.
//   field_quality ITERATIONS SEEDS LEAST MOST GAUSSIANS DOWNSCALE ARMS DATASET...
// LEAST, MOST: budgets, anchors; GAUSSIANS: per anchor; ARMS: what is fitted, parted by commas;
// every sixth view is held out.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <iterator>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "decode/tree/hierarchy_decoder.h"
#include "decode/tree/merge_tree.h"
#include "io/views/dataset.h"
#include "model/field_splats.h"
#include "train/loop/explicit_model.h"
#include "train/loop/field_model.h"
#include "train/loop/trainer.h"

namespace stipple {
namespace {

constexpr uint64_t kHoldOut = 6;
/// Fits that are compared.
const std::string kField = "field", kGradientOff = "gradient off", kJitterOff = "jitter off",
                  kCut = "explicit cut", kOtherSeed = "another seed";

struct Settings {
  uint64_t iterations, seeds, least, most;
  uint32_t gaussians;
  std::vector<std::string> arms;

  std::vector<uint64_t> budgets() const {
    std::vector<uint64_t> all;
    for (uint64_t b = most; b >= least && b > 0; b /= 2) all.insert(all.begin(), b);
    return all;
  }
};

/// Held-out PSNR over black by budget, dB.
using Curve = std::vector<double>;

class Scene {
 public:
  Scene(const std::string& path, uint32_t downscale, const Settings& settings)
      : settings_(settings) {
    DatasetOptions options;
    options.downscale = downscale;
    views_ = openDataset(path, options);
    split_ = splitViews(*views_, kHoldOut);
  }

  Curve field(uint64_t seed, bool gradient, bool jitter) const {
    FieldModelOptions options;
    options.least_anchors = settings_.least;
    options.most_anchors = settings_.most;
    options.gaussians_per_anchor = settings_.gaussians;
    options.density_gradient = gradient;
    options.jitter = jitter;
    options.seed = seed;
    Trainer trainer(*cpuBackends(), views_, split_,
                    makeFieldModel(*cpuBackends(), *views_, split_.training, options),
                    trainerOptions(seed));
    FitObserver nobody;
    trainer.run(nobody);
    Curve curve;
    for (const FitMeasure& measure : trainer.history().by_budget) curve.push_back(measure.psnr);
    other_seeds_[seed] = decodedAnew(trainer.model());
    return curve;
  }

  /// The last fit of this seed, decoded with another one: the mean of four.
  const Curve& otherSeeds(uint64_t seed) const {
    const auto found = other_seeds_.find(seed);
    if (found == other_seeds_.end()) {
      throw std::invalid_argument("'" + kOtherSeed + "' comes after '" + kField + "'");
    }
    return found->second;
  }

  /// Of explicit splats, as many as the largest budget has at most, cut by their merge tree.
  Curve cuts(uint64_t seed) const {
    const uint64_t most = settings_.most * settings_.gaussians;
    ExplicitModelOptions options;
    options.sh_degree = 0;
    options.antialias = Antialias::kMip;
    options.start_splats = std::min<uint64_t>(most / 2, views_->points().size());
    options.max_splats = most;
    options.seed = seed;
    TrainerOptions how = trainerOptions(seed);
    how.max_splats = most;
    Trainer trainer(*cpuBackends(), views_, split_,
                    makeExplicitModel(*cpuBackends(), *views_, split_.training, options), how);
    FitObserver nobody;
    trainer.run(nobody);
    const auto leaves = std::make_shared<SplatCloud>(trainer.model().splats(0));
    const auto tree = std::make_shared<MergeTree>(buildMergeTree(*leaves, {}, {}));
    const HierarchyDecoder decoder(leaves, tree);
    PictureStore pictures(views_, uint64_t{1} << 30);
    ViewMeasure judge(*cpuBackends());
    const double black[3] = {0, 0, 0};
    Curve curve;
    for (const uint64_t budget : settings_.budgets()) {
      DecodeRequest request;
      request.budget = std::min<uint64_t>(budget * settings_.gaussians, leaves->size());
      curve.push_back(
          judge.measure(decoder.decode(request), pictures, split_.held_out, black).psnr);
    }
    return curve;
  }

 private:
  Curve decodedAnew(FitModel& fitted) const {
    const FieldResult learned = *fieldResult(fitted);
    const auto model = makeFieldSplats(std::make_shared<const OctreeDensity>(learned.density),
                                       learned.field, learned.draws);
    PictureStore pictures(views_, uint64_t{1} << 30);
    ViewMeasure judge(*cpuBackends());
    const double black[3] = {0, 0, 0};
    Curve curve(settings_.budgets().size(), 0.0);
    for (size_t b = 0; b < curve.size(); ++b) {
      for (const uint64_t seed : {1, 2, 3, 4}) {
        ModelRequest request;
        request.budget = settings_.budgets()[b];
        request.gaussians_per_anchor = settings_.gaussians;
        request.seed = seed;
        const SplatCloud cloud = model->decode(request);
        curve[b] += judge.measure(cloud, pictures, split_.held_out, black).psnr / 4;
      }
    }
    return curve;
  }

  TrainerOptions trainerOptions(uint64_t seed) const {
    TrainerOptions options;
    options.iterations = settings_.iterations;
    options.seed = seed;
    return options;
  }

  Settings settings_;
  std::shared_ptr<const ViewSource> views_;
  FitViews split_;
  mutable std::map<uint64_t, Curve> other_seeds_;  ///< of the last field of each seed
};

void print(const std::string& name, const Curve& curve) {
  std::printf("%-28s", name.c_str());
  for (const double psnr : curve) std::printf(" %7.2f", psnr);
  std::printf("\n");
  std::fflush(stdout);
}

Curve mean(const std::vector<Curve>& curves) {
  Curve sum(curves[0].size(), 0.0);
  for (const Curve& curve : curves) {
    for (size_t i = 0; i < sum.size(); ++i) {
      sum[i] += curve[i] / static_cast<double>(curves.size());
    }
  }
  return sum;
}

/// Student's t of 95 %, both sides, by degrees of freedom.
double studentT(size_t freedom) {
  constexpr double kValues[] = {12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262,
                                2.228,  2.201, 2.179, 2.160, 2.145, 2.131, 2.120, 2.110, 2.101};
  return kValues[std::min<size_t>(freedom, std::size(kValues)) - 1];
}

/// Mean of the paired differences and half their 95 % interval, by budget.
void printDifferences(const std::string& name, const std::vector<Curve>& on,
                      const std::vector<Curve>& off) {
  std::printf("%-28s", name.c_str());
  const double count = static_cast<double>(on.size());
  for (size_t b = 0; b < on[0].size(); ++b) {
    double sum = 0, squares = 0;
    for (size_t i = 0; i < on.size(); ++i) {
      const double d = on[i][b] - off[i][b];
      sum += d;
      squares += d * d;
    }
    const double variance = on.size() > 1 ? (squares - sum * sum / count) / (count - 1) : 0;
    const double half =
        on.size() > 1 ? studentT(on.size() - 1) * std::sqrt(std::max(variance, 0.0) / count) : 0;
    std::printf("  %+.2f+-%.2f", sum / count, half);
  }
  std::printf("\n");
}

Curve curveOf(const Scene& scene, const std::string& arm, uint64_t seed) {
  if (arm == kField) return scene.field(seed, true, true);
  if (arm == kGradientOff) return scene.field(seed, false, true);
  if (arm == kJitterOff) return scene.field(seed, true, false);
  if (arm == kCut) return scene.cuts(seed);
  if (arm == kOtherSeed) return scene.otherSeeds(seed);
  throw std::invalid_argument("'" + arm + "' is not one of " + kField + ", " + kGradientOff + ", " +
                              kJitterOff + ", " + kCut + ", " + kOtherSeed);
}

/// What is asked for, parted by commas.
std::vector<std::string> armsOf(const std::string& text) {
  std::vector<std::string> arms;
  for (size_t at = 0; at <= text.size();) {
    const size_t end = std::min(text.find(',', at), text.size());
    arms.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return arms;
}

void run(const Settings& settings, uint32_t downscale, const std::vector<std::string>& paths) {
  std::printf("%-28s", "Gaussians");
  for (const uint64_t b : settings.budgets()) {
    std::printf(" %7llu", static_cast<unsigned long long>(b * settings.gaussians));
  }
  std::printf("\n");
  std::map<std::string, std::vector<Curve>> all;
  for (const std::string& path : paths) {
    const Scene scene(path, downscale, settings);
    const std::string name = path.substr(path.find_last_of('/') + 1);
    std::map<std::string, std::vector<Curve>> here;
    for (uint64_t seed = 0; seed < settings.seeds; ++seed) {
      for (const std::string& arm : settings.arms) here[arm].push_back(curveOf(scene, arm, seed));
    }
    for (const auto& [what, curves] : here) {
      print(name + ", " + what, mean(curves));
      all[what].insert(all[what].end(), curves.begin(), curves.end());
    }
  }
  for (const auto& [what, curves] : all) print("all, " + what, mean(curves));
  const auto compare = [&all](const char* name, const std::string& other) {
    if (all.contains(kField) && all.contains(other)) {
      printDifferences(name, all[kField], all[other]);
    }
  };
  compare("gradient on - off", kGradientOff);
  compare("jitter on - off", kJitterOff);
  compare("field - explicit cut", kCut);
  compare("own seed - another", kOtherSeed);
}

}  // namespace
}  // namespace stipple

int main(int argc, char** argv) {
  if (argc < 9) {
    std::fprintf(stderr,
                 "field_quality ITERATIONS SEEDS LEAST MOST GAUSSIANS DOWNSCALE ARMS DATASET...\n");
    return 2;
  }
  const auto number = [&](int i) { return std::strtoull(argv[i], nullptr, 10); };
  try {
    stipple::run({number(1), number(2), number(3), number(4), static_cast<uint32_t>(number(5)),
                  stipple::armsOf(argv[7])},
                 static_cast<uint32_t>(number(6)), {argv + 8, argv + argc});
  } catch (const std::exception& error) {
    std::fprintf(stderr, "field_quality: %s\n", error.what());
    return 1;
  }
  return 0;
}
