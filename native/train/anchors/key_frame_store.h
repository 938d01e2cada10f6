#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>

#include "data/tensor_table.h"

namespace stipple {

/// Keeps what a fit of a long clip has finished and not at hand: parts are written once, under
/// names of their own, and read when their turn comes.
class KeyFrameStore {
 public:
  virtual ~KeyFrameStore() = default;
  /// Forgets what an earlier fit has left.
  virtual void clear() = 0;
  /// Errors: kIo.
  virtual void put(const std::string& name, const TensorTable& table) = 0;
  /// Empty where there is no such part. Errors: kIo, kFormat.
  virtual std::optional<TensorTable> get(const std::string& name) const = 0;
};

/// In memory, where nobody has said where files may be.
class MemoryKeyFrames final : public KeyFrameStore {
 public:
  void clear() override { parts_.clear(); }
  void put(const std::string& name, const TensorTable& table) override { parts_[name] = table; }
  std::optional<TensorTable> get(const std::string& name) const override {
    const auto found = parts_.find(name);
    if (found == parts_.end()) return {};
    return found->second;
  }

 private:
  std::map<std::string, TensorTable> parts_;
};

}  // namespace stipple
