#include "network_golden/stages.h"

namespace stipple {

void decoderStages(const GoldenFile&, StageReport&) {}

}  // namespace stipple
