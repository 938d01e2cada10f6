#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "model/model_settings.h"
#include "model/splat_model.h"

namespace stipple {

/// A kind of model, as the table knows it.
struct ModelKind {
  const char* name;   ///< what SplatModel::kind() returns, and "kind" in the metadata of assets
  const char* label;  ///< for people
  uint32_t number;    ///< of StippleModelKind in the C header
  ModelTraits traits;
  /// Reads an asset file of this kind. Errors: kIo, kFormat; kUnavailable where it needs weights
  /// that are not there; kCancelled.
  std::shared_ptr<const SplatModel> (*read)(const std::string& path, const ReadingAid& aid);
};

/// The table: all kinds that there are.
std::span<const ModelKind> modelKinds();

/// The row of a model's kind. In: name, which the table has.
const ModelKind& modelKind(std::string_view name);

/// The model of an asset file. Errors: those of ModelKind::read; kUnsupported for a kind that the
/// table does not have, or a newer major version.
std::shared_ptr<const SplatModel> loadModel(const std::string& path, const ReadingAid& aid = {});

}  // namespace stipple
