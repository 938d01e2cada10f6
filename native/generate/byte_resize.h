#pragma once

#include <cstdint>

#include "data/images/byte_image.h"

namespace stipple {

/// Resizes by a Lanczos filter of three lobes that is widened where the picture shrinks, in whole
/// numbers and so with the same bytes everywhere: a horizontal pass, rounded to bytes, then a
/// vertical one. Colours are multiplied by alpha before and divided by it afterwards. A size that
/// stays is not touched.
/// In: image that requireByteImage() takes; width, height: at least 1.
/// Threads and determinism: parallel over rows; same bytes for any number of threads.
/// Differs from the imaging library that networks were trained with (Pillow 9 to 11) in no byte.
ByteImage resizeBytes(const ByteImage& image, uint32_t width, uint32_t height);

}  // namespace stipple
