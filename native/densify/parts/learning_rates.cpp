#include "densify/parts/learning_rates.h"

namespace stipple {

namespace {

class OwnRates final : public ControlPart {
 public:
  explicit OwnRates(const LearningRates& rates) : rates_(rates) {}

  const char* name() const override { return "learning_rates"; }
  ControlRoles owns() const override { return 0; }
  void adjustRates(LearningRates& rates) const override { rates = rates_; }

 private:
  LearningRates rates_;
};

}  // namespace

std::unique_ptr<ControlPart> makeLearningRates(const LearningRates& rates) {
  return std::make_unique<OwnRates>(rates);
}

}  // namespace stipple
