// Based on: Kerbl, Kopanas, Leimkuehler, Drettakis, 3D Gaussian Splatting for Real-Time Radiance
// Field Rendering, SIGGRAPH 2023, section 5.2, with the constants of its published fits. Differs:
// there is a hard cap of the count; large splats are judged by their size in the world alone, as
// the published program does in effect; short fits leave resets out; the last splat stays.

#include "densify/strategies/adaptive.h"

namespace stipple {

ControlAssembly adaptiveControl(const AdaptiveOptions& options) {
  ControlAssembly assembly;
  assembly.schedule = options.schedule;
  addPart(assembly, makeScreenPull(options.pull));
  addPart(assembly, makeCloneOrSplit(options.children));
  addPart(assembly, makeFaintRemoval(options.removal));
  addPart(assembly, makeOpacityReset(options.reset));
  return assembly;
}

}  // namespace stipple
