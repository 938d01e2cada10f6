#pragma once

#include "data/views/view_source.h"

namespace stipple {

/// Premultiplied colour and alpha of a picture of `width` and `height` from pixels [H,W,4]; an
/// alpha of 1 everywhere is left out.
void takeRgba(const float* rgba, ViewPicture& picture);

/// The other way round; alpha is 1 where the picture has none.
void giveRgba(const ViewPicture& picture, float* rgba);

/// Depths of kEmptyDepth and more, where a renderer saw nothing, become 0: unknown.
void forgetEmptyDepth(ViewPicture& picture);

}  // namespace stipple
