#pragma once

#include "data/images/image.h"
#include "data/views/view_source.h"

namespace stipple {

/// Brings colours that relate to light by `from` into the space in which they are composited. The
/// curve belongs to the straight colour; where alpha is 0 it is applied to the value as it stands.
void convertColours(ViewPicture& picture, Transfer from, ColourSpace to);
/// The same for a picture that knows its transfer.
void convertColours(Image& image, ColourSpace to);

}  // namespace stipple
