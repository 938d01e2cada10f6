#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "base/progress.h"
#include "data/views/view_source.h"

namespace stipple {

/// Refuses a picture that is not its camera's: sizes that disagree, values that are not finite
/// (named by picture, array and pixel), alpha outside 0..1, negative weights and depths.
void validateView(const Camera& camera, const ViewPicture& picture, const std::string& name);

/// Refuses arrays of other sizes (normals, areas and weights may be empty: points of a
/// reconstruction have none), and values that are not finite.
void validatePoints(const PointSet& points, const char* what);

struct ViewCheckOptions {
  /// Pictures that are loaded and looked at, spread evenly over all. Raising it finds more and
  /// takes the time of loading them.
  size_t picture_count = 64;
};

/// Looks at views before work that takes long begins.
/// Returns: sentences on what is odd but can be worked with: pictures that are black, transparent
/// or masked out everywhere, cameras that see none of the points, one camera alone.
/// Errors: kInvalidArgument where nothing can be learned: no views, pictures that all show nothing,
/// cameras of which none sees any point; and those of load().
std::vector<std::string> checkViews(const ViewSource& views, const ViewCheckOptions& options = {},
                                    Progress* progress = nullptr);

}  // namespace stipple
