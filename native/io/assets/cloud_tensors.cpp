#include "io/assets/cloud_tensors.h"

#include "base/error.h"
#include "io/assets/asset_header.h"
#include "io/assets/network_tensors.h"

namespace stipple {

void setCloudFlags(SafeTensorsWriter& file, const SplatCloud& cloud) {
  setSplatFlags(file, cloud.colour_space, cloud.antialias);
  file.setMetadata("frame", frameName(cloud.frame));
  file.setMetadata("sh_degree", std::to_string(cloud.sh_degree));
}

SplatCloud readCloudFlags(const SafeTensorsReader& file) {
  SplatCloud flags;
  readSplatFlags(file, flags.colour_space, flags.antialias);
  const std::string& frame = requireText(file, "frame");
  const auto known = frameFromName(frame);
  if (!known) {
    fail(ErrorCode::kFormat, file.path() + " has the frame '" + frame.substr(0, 40) +
                                 "'; three letters such as RDF, or 'unknown', are needed");
  }
  flags.frame = *known;
  const std::string& degree = requireText(file, "sh_degree");
  if (degree.size() != 1 || degree[0] < '0' || degree[0] > '0' + kMaxShDegree) {
    fail(ErrorCode::kFormat,
         file.path() + " has sh_degree = " + degree.substr(0, 40) + "; 0 to 4 is needed");
  }
  flags.sh_degree = degree[0] - '0';
  return flags;
}

void addCloudTensors(SafeTensorsWriter& file, const std::string& stem, const SplatCloud& cloud) {
  file.add(stem + "positions", cloud.positions, 3);
  file.add(stem + "rotations", cloud.rotations, 4);
  file.add(stem + "scales", cloud.scales, 3);
  file.add(stem + "opacities", cloud.opacities, 1);
  file.add(stem + "sh", cloud.sh, cloud.shStride());
}

SplatCloud readCloudTensors(const SafeTensorsReader& file, const std::string& stem,
                            const SplatCloud& flags) {
  SplatCloud cloud = flags;
  cloud.positions = file.readFloats(stem + "positions", 3);
  cloud.rotations = file.readFloats(stem + "rotations", 4);
  cloud.scales = file.readFloats(stem + "scales", 3);
  cloud.opacities = file.readFloats(stem + "opacities", 1);
  cloud.sh = file.readFloats(stem + "sh", cloud.shStride());
  return cloud;
}

}  // namespace stipple
