#pragma once

namespace stipple {

/// Rotates a unit quaternion w,x,y,z, in place, about the axes of the world: by twice the angle
/// whose tangent is the length of `turn`, about its direction. turn: [3], of a length of at most
/// 1e18.
void turnQuaternion(const float* turn, float* wxyz);

/// In: wxyz: turned. In and out: by_rotation [4]: derivatives by it, which become those by the
/// quaternion before. Out: by_turn [3].
void turnQuaternionBackward(const float* turn, const float* wxyz, float* by_rotation,
                            float* by_turn);

}  // namespace stipple
