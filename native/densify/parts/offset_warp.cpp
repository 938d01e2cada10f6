#include "densify/parts/offset_warp.h"

namespace stipple {

namespace {

class OffsetWarp final : public ControlPart {
 public:
  explicit OffsetWarp(const TimeStretch& stretch) : stretch_(stretch) {}

  const char* name() const override { return "offset_warp"; }
  ControlRoles owns() const override { return roles(ControlRole::kTime); }
  void adjustStretch(TimeStretch& stretch) const override { stretch = stretch_; }

 private:
  TimeStretch stretch_;
};

}  // namespace

std::unique_ptr<ControlPart> makeOffsetWarp(const TimeStretch& stretch) {
  return std::make_unique<OffsetWarp>(stretch);
}

}  // namespace stipple
