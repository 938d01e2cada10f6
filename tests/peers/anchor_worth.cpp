// What an anchor is worth to the images of an object, in three ways, on trained networks:
//   summed    the loss with each of its Gaussians minus the loss without, summed: the density
//   gradient's measure removed   the same for all of its Gaussians at once decoded   the loss with
//   the anchor minus the loss where the network decodes all other anchors alone
// The density gradient asks for the third: which density has the smaller loss once it is decoded.
// The program prints how the first two agree with it, and how many anchors would be asked for more
// of by each.
//
//   anchor_worth WEIGHTS COLLECTION [--anchors 128] [--objects 6] [--csv FILE]

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "decode/latent/latent_decoder.h"
#include "decode/latent/latent_density.h"
#include "density/contribution_normalisation.h"
#include "fit/training/collection.h"
#include "fit/training/training_config.h"
#include "io/assets/weight_file.h"
#include "model/latent_splats.h"
#include "train/backend/backend_table.h"

namespace stipple {
namespace {

struct Arguments {
  std::string weights, collection, csv;
  uint64_t anchors = 128, objects = 6;
};

/// Draws clouds before black and compares them with all views of one object.
class Judge {
 public:
  Judge(const BackendFactory& backends, const ObjectViews& views) : pass_(backends.makeViewPass()) {
    for (size_t i = 0; i < views.count(); ++i) views_.push_back(views.view(i));
  }

  /// Mean L1 over views; contributions of each splat to it, where asked for.
  double loss(const SplatCloud& cloud, std::vector<double>* contributions) {
    RenderOptions options;
    options.with_depth = false;
    options.with_background = true;
    std::fill_n(options.background, 3, 0.0f);
    StatisticRequest request;
    request.contributions = contributions != nullptr;
    double sum = 0;
    const double share = 1 / static_cast<double>(views_.size());
    for (const ObjectView& view : views_) {
      pass_->forward(cloud, view.camera, options);
      sum += share * pass_->loss(view.image, {}, lossFor(request, 0)).l1;
      if (contributions == nullptr) continue;
      pass_->backward(request);
      const std::span<const float> of_view = pass_->statistic(Statistic::kContributions);
      contributions->resize(of_view.size(), 0.0);
      for (size_t n = 0; n < of_view.size(); ++n)
        (*contributions)[n] += share * static_cast<double>(of_view[n]);
    }
    return sum;
  }

 private:
  std::unique_ptr<ViewPass> pass_;
  std::vector<ObjectView> views_;
};

AnchorSet without(const AnchorSet& anchors, size_t left_out) {
  AnchorSet made;
  made.leaf_level = anchors.leaf_level;
  for (size_t i = 0; i < anchors.size(); ++i) {
    if (i == left_out) continue;
    for (size_t axis = 0; axis < 3; ++axis)
      made.positions.push_back(anchors.positions[i * 3 + axis]);
    made.log_q.push_back(anchors.log_q[i]);
    made.leaves.push_back(anchors.leaves[i]);
  }
  return made;
}

double correlation(const std::vector<double>& a, const std::vector<double>& b) {
  const double count = static_cast<double>(a.size());
  const double mean_a = std::accumulate(a.begin(), a.end(), 0.0) / count;
  const double mean_b = std::accumulate(b.begin(), b.end(), 0.0) / count;
  double ab = 0, aa = 0, bb = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    ab += (a[i] - mean_a) * (b[i] - mean_b);
    aa += (a[i] - mean_a) * (a[i] - mean_a);
    bb += (b[i] - mean_b) * (b[i] - mean_b);
  }
  return ab / std::sqrt(std::max(aa * bb, 1e-300));
}

std::vector<double> ranks(const std::vector<double>& of) {
  std::vector<size_t> order(of.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) { return of[a] < of[b]; });
  std::vector<double> made(of.size());
  for (size_t i = 0; i < order.size(); ++i) made[order[i]] = static_cast<double>(i);
  return made;
}

double mean(const std::vector<double>& of) {
  return std::accumulate(of.begin(), of.end(), 0.0) / static_cast<double>(of.size());
}

/// How alike two normalised measures point: the cosine of the angle between them.
double alike(std::vector<double> a, std::vector<double> b) {
  normaliseContributions({.counts_neutral = true}, a);
  normaliseContributions({.counts_neutral = true}, b);
  double ab = 0, aa = 0, bb = 0;
  for (size_t i = 0; i < a.size(); ++i) ab += a[i] * b[i], aa += a[i] * a[i], bb += b[i] * b[i];
  return ab / std::sqrt(std::max(aa * bb, 1e-300));
}

int run(const Arguments& given) {
  std::map<std::string, std::string> metadata;
  const WeightTable weights = openWeightFile(given.weights, &metadata);
  const TrainingConfig config = readSettings(metadata.at(kTrainedKey), given.weights);
  const DensityAutoencoder networks(config.sizes);
  const std::vector<float> values = networks.layout().read(weights);
  const LatentNetworks decoders = openLatentNetworks(given.weights);
  const Collection collection(given.collection, config.objects);
  const std::shared_ptr<const BackendFactory> backends = chosenBackends();
  size_t tokens = 1;
  for (const AutoencoderSchedule& part : config.parts) tokens = std::max(tokens, part.most_tokens);
  std::FILE* const csv = given.csv.empty() ? nullptr : std::fopen(given.csv.c_str(), "w");
  if (csv != nullptr) std::fprintf(csv, "object,x,y,z,summed,removed,decoded\n");
  std::printf(
      "object | L1 | mean summed | removed | decoded | rank correlation with decoded: summed | "
      "removed | "
      "cosine of normalised: summed | removed | share harmful: summed | removed | decoded\n");
  const uint64_t held_out = config.held_out == 0 ? 1 : config.held_out;
  uint64_t done = 0;
  for (size_t object = 0; object < collection.count() && done < given.objects;
       object += held_out, ++done) {
    auto latent = std::make_shared<Latent>();
    latent->width = static_cast<uint32_t>(config.sizes.latent_width);
    latent->tokens = networks.encode(values, *collection.object(object), tokens);
    latent->token_count = latent->tokens.size() / latent->width;
    const LatentDensity density(decoders.octree, latent, {}, config.sizes.leaf_level);
    const LatentDecoder decoder(decoders.gaussians, latent);
    const uint32_t gaussians = decoders.gaussians->gaussians();
    const AnchorSet anchors = sampleAnchors(density, {.count = given.anchors, .seed = 1});
    const auto decode = [&](const AnchorSet& set) {
      DecodeRequest request;
      request.anchors = &set;
      request.gaussians_per_anchor = gaussians;
      return decoder.decode(request);
    };
    Judge judge(*backends, *collection.object(object)->views);
    const SplatCloud whole = decode(anchors);
    std::vector<double> each;
    const double loss = judge.loss(whole, &each);
    std::vector<double> summed(anchors.size(), 0.0), removed, decoded;
    for (size_t n = 0; n < each.size(); ++n) summed[n / gaussians] += each[n];
    for (size_t anchor = 0; anchor < anchors.size(); ++anchor) {
      SplatCloud rest = whole;
      std::fill_n(rest.opacities.begin() + static_cast<std::ptrdiff_t>(anchor * gaussians),
                  gaussians, 0.0f);
      removed.push_back(loss - judge.loss(rest, nullptr));
      decoded.push_back(loss - judge.loss(decode(without(anchors, anchor)), nullptr));
      if (csv != nullptr) {
        const float* at = &anchors.positions[anchor * 3];
        std::fprintf(csv, "%s,%g,%g,%g,%g,%g,%g\n", collection.name(object).c_str(),
                     static_cast<double>(at[0]), static_cast<double>(at[1]),
                     static_cast<double>(at[2]), summed[anchor], removed.back(), decoded.back());
      }
    }
    const auto harmful = [](const std::vector<double>& of) {
      return static_cast<double>(
                 std::count_if(of.begin(), of.end(), [](double v) { return v > 0; })) /
             static_cast<double>(of.size());
    };
    std::printf("%s | %.5f | %.2e | %.2e | %.2e | %.3f | %.3f | %.3f | %.3f | %.2f | %.2f | %.2f\n",
                collection.name(object).c_str(), loss, mean(summed), mean(removed), mean(decoded),
                correlation(ranks(summed), ranks(decoded)),
                correlation(ranks(removed), ranks(decoded)), alike(summed, decoded),
                alike(removed, decoded), harmful(summed), harmful(removed), harmful(decoded));
    std::fflush(stdout);
  }
  if (csv != nullptr) std::fclose(csv);
  return 0;
}

}  // namespace
}  // namespace stipple

int main(int count, char** texts) {
  stipple::Arguments given;
  std::vector<std::string> places;
  for (int i = 1; i < count; ++i) {
    const std::string text = texts[i];
    if (text == "--anchors" && i + 1 < count)
      given.anchors = std::strtoull(texts[++i], nullptr, 10);
    else if (text == "--objects" && i + 1 < count)
      given.objects = std::strtoull(texts[++i], nullptr, 10);
    else if (text == "--csv" && i + 1 < count)
      given.csv = texts[++i];
    else
      places.push_back(text);
  }
  if (places.size() != 2) {
    std::fprintf(stderr,
                 "anchor_worth WEIGHTS COLLECTION [--anchors 128] [--objects 6] [--csv FILE]\n");
    return 2;
  }
  given.weights = places[0];
  given.collection = places[1];
  try {
    return stipple::run(given);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "anchor_worth: %s\n", error.what());
    return 1;
  }
}
