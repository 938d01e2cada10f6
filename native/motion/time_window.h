#pragma once

#include <algorithm>
#include <cstdint>

namespace stipple {

/// How time is stretched about the moment of a splat: a window of `span` frames gets `share` of a
/// unit range, and the rest of the clip the other part. After TAD-GS (arXiv 2606.23212), where it
/// is called offset warping.
struct TimeWindow {
  double half = 0;  ///< half the window, as a part of the clip; 0: time is not stretched
  double near = 1;  ///< slope inside the window
  double far = 1;   ///< slope outside
};

/// Frames of a window and its share of the range where nothing else is said, as released.
constexpr double kWindowFrames = 50;
constexpr double kWindowShare = 0.7;

/// The window of a clip. A window longer than half of the clip is cut to that, since nothing would
/// be left outside of a clip as long as its window; a clip of one frame has none.
/// In: span >= 0 frames, 0 stands for no window; share above 0 and below 1.
inline TimeWindow timeWindow(uint32_t frame_count, double span = kWindowFrames,
                             double share = kWindowShare) {
  if (frame_count < 2 || span <= 0) return {};
  const double part = std::min(span / frame_count, 0.5);
  return {part / 2, share / part, (1 - share) / (1 - part)};
}

/// How far the time is from the centre of a splat, stretched. Continuous and rising in time, of
/// range 1 over the clip. Windows of centres near the ends are moved inside the clip.
/// In: time and centre as parts of the clip, 0..1.
template <typename T>
T stretchedOffset(const TimeWindow& window, T time, T centre) {
  if (window.half <= 0) return time - centre;
  const T whole = T(2 * window.half);
  const T begin = std::clamp(centre - T(window.half), T(0), T(1) - whole);
  const T inside = std::clamp(time, begin, begin + whole);
  return (inside - centre) * T(window.near) + (time - inside) * T(window.far);
}

}  // namespace stipple
