#include <algorithm>

#include "base/error.h"
#include "io/assets/asset_header.h"
#include "model/model_kinds.h"

namespace stipple {

namespace {

const ModelKind* find(std::string_view name) {
  const std::span<const ModelKind> kinds = modelKinds();
  const auto found = std::find_if(kinds.begin(), kinds.end(),
                                  [&](const ModelKind& kind) { return name == kind.name; });
  return found == kinds.end() ? nullptr : &*found;
}

}  // namespace

const ModelKind& modelKind(std::string_view name) {
  const ModelKind* kind = find(name);
  if (!kind) {
    fail(ErrorCode::kInternal, "the table of model kinds has no '" + std::string(name) + "'");
  }
  return *kind;
}

std::shared_ptr<const SplatModel> loadModel(const std::string& path, const ReadingAid& aid) {
  const std::string name = readAssetKind(path);
  if (const ModelKind* kind = find(name)) return kind->read(path, aid);
  std::string known;
  for (const ModelKind& kind : modelKinds()) {
    known += (known.empty() ? "'" : "', '") + std::string(kind.name);
  }
  fail(ErrorCode::kUnsupported, path + " is a Stipple asset of kind '" + name.substr(0, 40) +
                                    "'; " + known + "' can be read");
}

}  // namespace stipple
