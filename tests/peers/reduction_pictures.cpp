// Reduces a cloud by its merge tree, with and without refinement, and compares pictures of 16 views
// with the full cloud, beside files that another program made at the same counts.
//   reduction_pictures --count FILE
//   reduction_pictures FILE VIEWS (BUDGET RULE SECONDS RESULT)...
// VIEWS: 0 automatic, 1 from around, 2 from inside.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "base/stopwatch.h"
#include "decode/tree/hierarchy_decoder.h"
#include "io/splats/splat_file.h"
#include "splat/render/render.h"
#include "train/loop/refine.h"
#include "train/loop/view_rig.h"
#include "train/loop/visibility.h"

namespace stipple {
namespace {

double secondsOf(const std::function<void()>& work) {
  const Stopwatch watch;
  work();
  return watch.seconds();
}

struct Psnr {
  double frame = 0;
  double foreground = 0;  ///< over the pixels that the full cloud covers by 1/255 or more
};

/// Views of other seeds than those that visibility and refinement look from.
class Judge {
 public:
  Judge(const SplatCloud& full, ViewRig kind) {
    ViewRigOptions rig;
    rig.rig = kind;
    rig.count = 16;
    rig.size = 800;
    rig.seed = 1234567;
    views_ = viewsOfCloud(*cpuBackends(), full, rig);
    for (const Camera& view : views_) wanted_.push_back(draw(full, view));
  }

  Psnr psnr(const SplatCloud& cloud) const {
    double all = 0, covered = 0;
    size_t all_count = 0, covered_count = 0;
    for (size_t v = 0; v < views_.size(); ++v) {
      const std::vector<float> seen = draw(cloud, views_[v]);
      for (size_t i = 0; i < seen.size(); i += 4) {
        double squared = 0;
        for (size_t c = 0; c < 3; ++c) {
          const double d = static_cast<double>(std::clamp(seen[i + c], 0.0f, 1.0f)) -
                           static_cast<double>(std::clamp(wanted_[v][i + c], 0.0f, 1.0f));
          squared += d * d;
        }
        all += squared;
        all_count += 3;
        if (wanted_[v][i + 3] < 1.0f / 255) continue;
        covered += squared;
        covered_count += 3;
      }
    }
    return {-10 * std::log10(all / static_cast<double>(all_count)),
            -10 * std::log10(covered / static_cast<double>(covered_count))};
  }

 private:
  static std::vector<float> draw(const SplatCloud& cloud, const Camera& camera) {
    RenderOptions options;
    options.with_depth = false;
    const SplatInstance instance{&cloud};
    return renderTiled({&instance, 1}, camera, options).colour;
  }

  std::vector<Camera> views_;
  std::vector<std::vector<float>> wanted_;
};

void print(const char* what, uint64_t budget, const Psnr& psnr, double seconds) {
  std::printf("%-26s %9llu %7.2f %7.2f %9.3f\n", what, static_cast<unsigned long long>(budget),
              psnr.frame, psnr.foreground, seconds);
  std::fflush(stdout);
}

void compare(int argc, char** argv) {
  const auto full = std::make_shared<const SplatCloud>(readSplatFile(argv[1]));
  const Judge judge(*full, static_cast<ViewRig>(std::clamp(std::atoi(argv[2]), 0, 2)));
  std::printf("%-26s %9s %7s %7s %9s\n", "", "splats", "frame", "foregr.", "seconds");
  std::map<uint64_t, double> peer_seconds;
  for (int i = 3; i + 3 < argc; i += 4) {
    const uint64_t budget = std::strtoull(argv[i], nullptr, 10);
    const double seconds = std::strtod(argv[i + 2], nullptr);
    print(argv[i + 1], budget, judge.psnr(readSplatFile(argv[i + 3])), seconds);
    double& least = peer_seconds.try_emplace(budget, seconds).first->second;
    least = std::min(least, seconds);
  }
  MergeTree tree;
  const double plain = secondsOf([&] { buildMergeTree(*full, {}, {}); });
  std::vector<float> visibility;
  const double looking = secondsOf([&] {
    visibility = splatVisibility(*cpuBackends(), *full,
                                 viewsForVisibility(*cpuBackends(), *full, ViewRigOptions()));
  });
  const double building = secondsOf([&] { tree = buildMergeTree(*full, visibility, {}); });
  std::printf("tree without pictures %.3f s; pictures %.3f s, tree %.3f s\n", plain, looking,
              building);
  const HierarchyDecoder decoder(full, std::make_shared<const MergeTree>(std::move(tree)));
  for (const auto& [budget, seconds] : peer_seconds) {
    DecodeRequest request;
    request.budget = budget;
    SplatCloud cut;
    double cutting = 0;
    withThreads(1, [&] { cutting = secondsOf([&] { cut = decoder.decode(request); }); });
    print("merge tree, cut", budget, judge.psnr(cut), cutting);
    RefineOptions options;
    options.iterations = 2000;
    options.seconds = seconds;  // as many steps as fit
    SplatCloud refined;
    const double refining =
        secondsOf([&] { refined = refineCloud(*cpuBackends(), cut, *full, options); });
    print("refined", budget, judge.psnr(refined), refining);
  }
}

}  // namespace
}  // namespace stipple

int main(int argc, char** argv) {
  try {
    if (argc == 3 && std::string(argv[1]) == "--count") {
      std::printf("%zu\n", stipple::readSplatFile(argv[2]).size());
      return 0;
    }
    if (argc < 7 || argc % 4 != 3) {
      std::fprintf(stderr,
                   "usage: reduction_pictures FILE VIEWS (BUDGET RULE SECONDS RESULT)...\n");
      return 2;
    }
    stipple::compare(argc, argv);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "reduction_pictures: %s\n", error.what());
    return 1;
  }
}
