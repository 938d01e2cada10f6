#pragma once

#include <optional>
#include <string>

#include "train/anchors/key_frame_store.h"

namespace stipple {

/// Key frames of a fit as files in a folder beside its checkpoint: the path of the checkpoint with
/// ".frames" behind it. The folder is made when the first is put there.
class KeyFrameFolder final : public KeyFrameStore {
 public:
  explicit KeyFrameFolder(const std::string& checkpoint_path);

  void clear() override;
  void put(const std::string& name, const TensorTable& table) override;
  std::optional<TensorTable> get(const std::string& name) const override;

 private:
  std::string pathOf(const std::string& name) const;

  std::string folder_;
};

}  // namespace stipple
