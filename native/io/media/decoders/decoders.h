#pragma once

#include <memory>
#include <string>
#include <vector>

#include "io/media/picture_file.h"

namespace stipple::media {

/// The bytes of a picture: of a file, which it holds, or of somebody who outlives it.
struct PictureBytes {
  std::vector<unsigned char> own;
  const unsigned char* data = nullptr;
  size_t count = 0;
  std::string name;  ///< what messages call it
};

/// One for each format. Errors: kFormat where the head is damaged, kUnsupported for what a format
/// may hold and this does not read.
std::unique_ptr<PictureFile> openPng(PictureBytes bytes);
std::unique_ptr<PictureFile> openJpeg(PictureBytes bytes);
std::unique_ptr<PictureFile> openWebp(PictureBytes bytes);
std::unique_ptr<PictureFile> openExr(const std::string& path);

/// Integers of 8 bits as 0..1: the channels [first, end) of rows of `channels`.
void toFloats(const unsigned char* values, size_t pixel_count, int channels, int first, int end,
              float* pixels);

}  // namespace stipple::media
