#include "model/model_kinds.h"

#include <array>

namespace stipple {

// The readers, each in the file of its kind.
std::shared_ptr<const SplatModel> readSurfaceSplats(const std::string& path, const ReadingAid&);
std::shared_ptr<const SplatModel> readHierarchySplats(const std::string& path, const ReadingAid&);
std::shared_ptr<const SplatModel> readFieldSplats(const std::string& path, const ReadingAid&);
std::shared_ptr<const SplatModel> readLatentSplats(const std::string& path, const ReadingAid&);
std::shared_ptr<const SplatModel> readMotionSplats(const std::string& path, const ReadingAid&);
std::shared_ptr<const SplatModel> readScaffoldSplats(const std::string& path, const ReadingAid&);
std::shared_ptr<const SplatModel> readRelaySplats(const std::string& path, const ReadingAid&);

std::span<const ModelKind> modelKinds() {
  static const std::array kinds = {
      ModelKind{"surface",
                "surface model",
                0,
                {.budget_unit = BudgetUnit::kAnchors,
                 .has_order = true,
                 .has_seed = true,
                 .has_smooth = true},
                readSurfaceSplats},
      ModelKind{"hierarchy",
                "hierarchy of splats",
                1,
                {.budget_unit = BudgetUnit::kSplats, .has_smooth = true, .takes_mask = true},
                readHierarchySplats},
      ModelKind{"field",
                "learned field",
                2,
                {.budget_unit = BudgetUnit::kAnchors,
                 .has_order = true,
                 .has_seed = true,
                 .has_smooth = true},
                readFieldSplats},
      ModelKind{"latent",
                "generated splats",
                3,
                {.budget_unit = BudgetUnit::kAnchors,
                 .has_order = true,
                 .has_seed = true,
                 .has_smooth = true},
                readLatentSplats},
      ModelKind{"motion",
                "moving splats",
                4,
                {.budget_unit = BudgetUnit::kSplats, .takes_mask = true},
                readMotionSplats},
      ModelKind{"scaffold",
                "anchors with features",
                5,
                {.budget_unit = BudgetUnit::kAnchors},
                readScaffoldSplats},
      ModelKind{"relay",
                "key frames of anchors",
                6,
                {.budget_unit = BudgetUnit::kAnchors},
                readRelaySplats},
  };
  return kinds;
}

}  // namespace stipple
