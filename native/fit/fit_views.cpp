#include "fit/fit_views.h"

#include <algorithm>
#include <set>
#include <span>

namespace stipple {

namespace {

// A hundred names would hide what the sentence says.
constexpr size_t kNamesInSentence = 4;

std::set<std::string> camerasOf(const ViewSource& views, std::span<const size_t> chosen) {
  std::set<std::string> names;
  for (const size_t view : chosen) {
    const std::string name = views.cameraName(view);
    if (!name.empty()) names.insert(name);
  }
  return names;
}

}  // namespace

FitViews splitAsTold(const ViewSource& views, uint64_t holdout) {
  FitViews split;
  for (size_t v = 0; v < views.count(); ++v) {
    const ViewRole role = views.role(v);
    if (role == ViewRole::kTest) {
      split.held_out.push_back(v);
    } else if (role != ViewRole::kValidation) {
      split.training.push_back(v);
    }
  }
  const bool is_told = !split.held_out.empty() && !split.training.empty();
  if (holdout == 0 || !is_told) return splitViews(views, holdout);
  return split;
}

std::string heldOutCameras(const ViewSource& views, const FitViews& split) {
  const std::set<std::string> held_out = camerasOf(views, split.held_out);
  const std::set<std::string> learned_from = camerasOf(views, split.training);
  if (held_out.empty()) {
    if (learned_from.empty()) return {};
    return (learned_from.size() == 1
                ? "the only camera is not held out"
                : "none of the " + std::to_string(learned_from.size()) + " cameras is held out") +
           std::string("; figures are of views that are learned from");
  }
  if (std::any_of(held_out.begin(), held_out.end(),
                  [&](const std::string& name) { return learned_from.count(name) != 0; })) {
    return "the data set holds out images of cameras that are learned from at other times";
  }
  std::string names;
  size_t named = 0;
  for (const std::string& name : held_out) {
    if (named++ < kNamesInSentence) names += (names.empty() ? "" : ", ") + name;
  }
  if (named > kNamesInSentence) {
    names += " and " + std::to_string(named - kNamesInSentence) + " more";
  }
  return std::to_string(learned_from.size()) + " cameras are learned from and " +
         std::to_string(held_out.size()) + " held out: " + names + " (" +
         std::to_string(split.held_out.size()) + " of " + std::to_string(views.count()) +
         " images)";
}

}  // namespace stipple
