#pragma once

namespace stipple {

/// How fast this machine runs networks: operations a second, a multiplication and an addition being
/// two.
struct MachineSpeed {
  double products = 0;   ///< of linear layers
  double attention = 0;  ///< of both products of an attention
};

/// Measured at the first call, on the threads that the caller may use: about a fifth of a second.
/// What else the machine does then enters it, so that it is for estimates alone.
const MachineSpeed& machineSpeed();

}  // namespace stipple
