#include "io/assets/checkpoint.h"

#include "io/assets/asset_header.h"
#include "io/bytes/output_kind.h"
#include "io/bytes/safetensors.h"

namespace stipple {

void requireCheckpointPlace(const std::string& path) {
  requireOutputKind(path, "a checkpoint", [](const std::string& file) {
    return readAssetKind(file) == kAssetCheckpoint;
  });
}

void writeCheckpoint(const std::string& settings_json, const TensorTable& tensors,
                     const std::string& path) {
  requireCheckpointPlace(path);
  SafeTensorsWriter file;
  setAssetKind(file, kAssetCheckpoint);
  setAssetChecksum(file);
  file.setMetadata("settings", settings_json);
  for (const auto& [name, tensor] : tensors) file.add(name, tensor);
  file.write(path);
}

void writeCheckpoint(const Checkpoint& checkpoint, const std::string& path) {
  writeCheckpoint(checkpoint.settings_json, checkpoint.tensors, path);
}

Checkpoint readCheckpoint(const std::string& path) {
  const SafeTensorsReader file(path);
  requireAssetKind(file, kAssetCheckpoint);
  requireAssetChecksum(file);
  Checkpoint checkpoint;
  checkpoint.settings_json = requireText(file, "settings");
  for (const auto& [name, tensor] : file.tensors()) {
    checkpoint.tensors.emplace(name, file.readTensor(name));
  }
  return checkpoint;
}

}  // namespace stipple
