#include "io/splats/ply/ply_comments.h"

#include <optional>
#include <sstream>

#include "base/error.h"
#include "io/splats/ply/ply_file.h"

namespace stipple {

namespace {

constexpr char kColourSpaceKey[] = "stipple_colour_space";
constexpr char kFrameKey[] = "stipple_frame";
constexpr char kRenderModeKey[] = "SplatRenderMode:";

}  // namespace

bool readPlyComments(const std::vector<std::string>& comments, const std::string& path,
                     SplatCloud& cloud) {
  bool has_mode = false;
  for (const std::string& comment : comments) {
    std::istringstream words(comment);
    std::string key;
    std::string value;
    words >> key >> value;
    if (key == kRenderModeKey) {
      cloud.antialias = value == "mip" ? Antialias::kMip : Antialias::kClassic;
      has_mode = true;
    } else if (key == "antialiased" && !has_mode) {
      cloud.antialias = value == "1" ? Antialias::kMip : Antialias::kClassic;
      has_mode = true;
    } else if (key == kColourSpaceKey) {
      if (value != kColourSpaceLinear && value != kColourSpaceDisplay) {
        fail(ErrorCode::kUnsupported, path + " has the colour space '" + value.substr(0, 60) +
                                          "'; " + kColourSpaceDisplay + " and " +
                                          kColourSpaceLinear + " are known");
      }
      cloud.colour_space =
          value == kColourSpaceLinear ? ColourSpace::kLinear : ColourSpace::kDisplay;
    } else if (key == kFrameKey) {
      const std::optional<Frame> frame = frameFromName(value);
      if (!frame || *frame == Frame::kUnknown) {
        fail(ErrorCode::kUnsupported, path + " has the frame '" + value.substr(0, 60) +
                                          "'; three letters such as RDF, RUB or RFU are known");
      }
      cloud.frame = *frame;
    }
  }
  return has_mode;
}

std::string plyComments(const SplatCloud& cloud) {
  std::string text =
      std::string("comment ") + kRenderModeKey +
      (cloud.antialias == Antialias::kMip ? " mip" : " default") + "\ncomment " + kColourSpaceKey +
      " " +
      (cloud.colour_space == ColourSpace::kLinear ? kColourSpaceLinear : kColourSpaceDisplay) +
      "\n";
  if (cloud.frame != Frame::kUnknown) {
    text += std::string("comment ") + kFrameKey + " " + frameName(cloud.frame) + "\n";
  }
  return text;
}

}  // namespace stipple
