// Based on: Rota Bulo, Porzi, Kontschieder, Revising Densification in Gaussian Splatting, ECCV
// 2024, section 3.3.

#include "densify/parts/opacity_correction.h"

#include "densify/quantities/opacity_forms.h"

namespace stipple {

namespace {

class OpacityCorrection final : public ControlPart {
 public:
  explicit OpacityCorrection(bool copies_alone) : copies_alone_(copies_alone) {}

  const char* name() const override { return "opacity_correction"; }
  ControlRoles owns() const override { return roles(ControlRole::kChildOpacity); }
  ControlRoles needs() const override { return roles(ControlRole::kMultiplication); }
  float childLogit(float parent_logit) const override { return sharedOpacityLogit(parent_logit); }
  bool changesCopiesAlone() const override { return copies_alone_; }

 private:
  bool copies_alone_;
};

}  // namespace

std::unique_ptr<ControlPart> makeOpacityCorrection(bool copies_alone) {
  return std::make_unique<OpacityCorrection>(copies_alone);
}

}  // namespace stipple
