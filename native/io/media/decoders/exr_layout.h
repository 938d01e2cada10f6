#pragma once

#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfPixelType.h>
#include <OpenEXR/ImfStdIO.h>

#include <fstream>
#include <string>
#include <vector>

#include "io/media/picture_file.h"

namespace stipple::media {

/// An open file. OpenEXR's own way to open one asks Windows for short names alone.
struct ExrStream {
  explicit ExrStream(const std::string& path);
  std::ifstream bytes;
  Imf::StdIFStream stream;
};

struct ExrChannel {
  std::string name;
  Imf::PixelType type = Imf::FLOAT;
};

/// The channels of a part, layer by layer: red, green, blue and alpha, then the others by their
/// names. Errors: kUnsupported for deep pixels and for channels of a coarser grid.
std::vector<ExrChannel> exrChannels(const Imf::Header& header, const std::string& name);

/// Size and place of a part's data. Errors: kFormat where they are none.
PictureHead exrWindows(const Imf::Header& header, const std::string& name);

}  // namespace stipple::media
