// Included inside a namespace, once by splat/render/projection_backward.h and once per instruction set by
// cpu/back_projector_vector.cpp, hence no include guard. As splat/render/projection_steps-inl.h: no step
// takes a decision and all have one order of operations, so lanes get the bits of the scalar code.

/// L, the inverse of the Cholesky factor of A A^T + variance I, and W = L A, whose rows are no
/// longer than 1. In: a [2][3]; deviation = sqrt(variance). W is made by orthogonalising the rows
/// of [A | deviation I] twice: once leaves a part of the first row in the second, 1e-16 times the
/// splat's aspect ratio, which turning a needle multiplies by its length.
template <typename T>
InverseFactor<T> whitenRows(const T (&a)[2][3], T deviation, T (&white)[2][3]) {
  const auto factor = factoriseRows(a[0], a[1], deviation);
  InverseFactor<T> l;
  l.l00 = T(1) / factor.r00;
  l.l11 = T(1) / factor.r11;
  l.l10 = T(0) - factor.r01 * l.l00 * l.l11;
  T second[3];
  for (int k = 0; k < 3; ++k) {
    white[0][k] = a[0][k] * l.l00;
    second[k] = a[1][k] - factor.r01 * white[0][k];
  }
  const T own = deviation * l.l00;
  const T left = white[0][0] * second[0] + white[0][1] * second[1] + white[0][2] * second[2] -
                 own * (factor.r01 * own);
  for (int k = 0; k < 3; ++k) white[1][k] = (second[k] - left * white[0][k]) * l.l11;
  return l;
}

/// Derivatives by what projectSteps reads, of a splat that it draws. In: centre [3] view space.
template <typename T, typename S>
void projectBackwardSteps(const View<S>& view, const Eigen::Matrix<S, 3, 3>& linear,
                          const T* centre, const SplatGeometry<T>& splat, LowPass low_pass,
                          const FootprintGradient<T>& by, ProjectionGradient<T>& out) {
  using std::abs;
  using std::max;
  using std::min;
  using std::sqrt;
  // Dividing by the largest component first keeps the squares inside the range of T.
  const T* q = splat.rotation;
  const T shrink = T(1) / max(max(abs(q[0]), abs(q[1])), max(abs(q[2]), abs(q[3])));
  T w = q[0] * shrink, x = q[1] * shrink, y = q[2] * shrink, z = q[3] * shrink;
  const T to_unit = T(1) / sqrt(w * w + x * x + y * y + z * z);
  w = w * to_unit;
  x = x * to_unit;
  y = y * to_unit;
  z = z * to_unit;
  const T turned[3][3] = {
      {T(1) - T(2) * (y * y + z * z), T(2) * (x * y - w * z), T(2) * (x * z + w * y)},
      {T(2) * (x * y + w * z), T(1) - T(2) * (x * x + z * z), T(2) * (y * z - w * x)},
      {T(2) * (x * z - w * y), T(2) * (y * z + w * x), T(1) - T(2) * (x * x + y * y)}};
  T axes[3][3];
  for (int k = 0; k < 3; ++k) {
    const T own[3] = {turned[0][k] * splat.scales[k], turned[1][k] * splat.scales[k],
                      turned[2][k] * splat.scales[k]};
    for (int i = 0; i < 3; ++i) {
      axes[i][k] = T(linear(i, 0)) * own[0] + T(linear(i, 1)) * own[1] + T(linear(i, 2)) * own[2];
    }
  }

  const S focal_px[2] = {view.fx, view.fy};
  T inverse_z = T(1);
  T focal[2] = {T(view.fx), T(view.fy)};
  T slope[2] = {T(0), T(0)};
  T held[2] = {T(0), T(0)};
  T a[2][3];
  if (view.perspective) {
    inverse_z = T(1) / centre[2];
    for (int axis = 0; axis < 2; ++axis) {
      focal[axis] = T(focal_px[axis]) * inverse_z;
      slope[axis] = centre[axis] * inverse_z;
      held[axis] = min(max(slope[axis], T(view.slope_min[axis])), T(view.slope_max[axis]));
      for (int k = 0; k < 3; ++k) {
        a[axis][k] = focal[axis] * (axes[axis][k] - held[axis] * axes[2][k]);
      }
    }
  } else {
    for (int axis = 0; axis < 2; ++axis) {
      for (int k = 0; k < 3; ++k) a[axis][k] = focal[axis] * axes[axis][k];
    }
  }

  // L and W = L A, whose rows are no longer than 1; then dL/dA = L^T M W.
  const S deviation = std::sqrt(lowPassVariance<S>(low_pass));
  T white[2][3];
  const InverseFactor<T> l = whitenRows(a, T(deviation), white);
  T by_a[2][3];
  for (int k = 0; k < 3; ++k) {
    const T first = by.second[0] * white[0][k] + by.second[1] * white[1][k];
    const T second = by.second[1] * white[0][k] + by.second[2] * white[1][k];
    by_a[0][k] = l.l00 * first + l.l10 * second;
    by_a[1][k] = l.l11 * second;
  }
  if (low_pass == LowPass::kMip) {
    // ln of the compensation is 1/2 (ln det A A^T - ln det C).
    T sharp_white[2][3];
    const InverseFactor<T> sharp = whitenRows(a, T(0), sharp_white);
    for (int k = 0; k < 3; ++k) {
      const T first = sharp_white[0][k];
      const T second = sharp_white[1][k];
      by_a[0][k] = by_a[0][k] + by.s * ((sharp.l00 * first + sharp.l10 * second) -
                                        (l.l00 * white[0][k] + l.l10 * white[1][k]));
      by_a[1][k] = by_a[1][k] + by.s * (sharp.l11 * second - l.l11 * white[1][k]);
    }
  }
  out.opacity = by.s / splat.opacity;
  out.mean[0] = l.l00 * by.first[0] + l.l10 * by.first[1];
  out.mean[1] = l.l11 * by.first[1];

  T by_axes[3][3];
  out.centre[2] = by.depth;
  for (int axis = 0; axis < 2; ++axis) {
    for (int k = 0; k < 3; ++k) by_axes[axis][k] = focal[axis] * by_a[axis][k];
    out.centre[axis] = focal[axis] * out.mean[axis];
  }
  if (view.perspective) {
    for (int axis = 0; axis < 2; ++axis) {
      const T along =
          by_a[axis][0] * axes[2][0] + by_a[axis][1] * axes[2][1] + by_a[axis][2] * axes[2][2];
      const T moved = out.centre[axis] - focal[axis] * inverse_z * along;
      // A held slope does not move with the centre.
      out.centre[axis] = pick(slope[axis] >= T(view.slope_min[axis]),
                              pick(T(view.slope_max[axis]) >= slope[axis], moved, out.centre[axis]),
                              out.centre[axis]);
      const T shrinking =
          by_a[axis][0] * a[axis][0] + by_a[axis][1] * a[axis][1] + by_a[axis][2] * a[axis][2];
      out.centre[2] = out.centre[2] - (out.centre[axis] * centre[axis] + shrinking) * inverse_z;
    }
    for (int k = 0; k < 3; ++k) {
      by_axes[2][k] = T(0) - (held[0] * by_axes[0][k] + held[1] * by_axes[1][k]);
    }
  } else {
    for (int k = 0; k < 3; ++k) by_axes[2][k] = T(0);
  }

  out.turn[0] = centre[1] * out.centre[2] - centre[2] * out.centre[1];
  out.turn[1] = centre[2] * out.centre[0] - centre[0] * out.centre[2];
  out.turn[2] = centre[0] * out.centre[1] - centre[1] * out.centre[0];
  T by_turned[3][3];
  for (int k = 0; k < 3; ++k) {
    out.turn[0] = out.turn[0] + (axes[1][k] * by_axes[2][k] - axes[2][k] * by_axes[1][k]);
    out.turn[1] = out.turn[1] + (axes[2][k] * by_axes[0][k] - axes[0][k] * by_axes[2][k]);
    out.turn[2] = out.turn[2] + (axes[0][k] * by_axes[1][k] - axes[1][k] * by_axes[0][k]);
    out.position[k] = T(linear(0, k)) * out.centre[0] + T(linear(1, k)) * out.centre[1] +
                      T(linear(2, k)) * out.centre[2];
    for (int i = 0; i < 3; ++i) {
      by_turned[i][k] = T(linear(0, i)) * by_axes[0][k] + T(linear(1, i)) * by_axes[1][k] +
                        T(linear(2, i)) * by_axes[2][k];
    }
    out.scales[k] = by_turned[0][k] * turned[0][k] + by_turned[1][k] * turned[1][k] +
                    by_turned[2][k] * turned[2][k];
    for (int i = 0; i < 3; ++i) by_turned[i][k] = by_turned[i][k] * splat.scales[k];
  }

  // As rotationGradientToQuaternion of math/quaternion_gradient.h.
  const auto& g = by_turned;
  T unit[4];
  unit[0] = z * (g[1][0] - g[0][1]) + y * (g[0][2] - g[2][0]) + x * (g[2][1] - g[1][2]);
  unit[1] = y * (g[0][1] + g[1][0]) + z * (g[0][2] + g[2][0]) + w * (g[2][1] - g[1][2]) -
            T(2) * x * (g[1][1] + g[2][2]);
  unit[2] = x * (g[0][1] + g[1][0]) + z * (g[1][2] + g[2][1]) + w * (g[0][2] - g[2][0]) -
            T(2) * y * (g[0][0] + g[2][2]);
  unit[3] = x * (g[0][2] + g[2][0]) + y * (g[1][2] + g[2][1]) + w * (g[1][0] - g[0][1]) -
            T(2) * z * (g[0][0] + g[1][1]);
  const T part[4] = {w, x, y, z};
  const T along = w * unit[0] + x * unit[1] + y * unit[2] + z * unit[3];
  for (int k = 0; k < 4; ++k) {
    out.rotation[k] = T(2) * (unit[k] - part[k] * along) * to_unit * shrink;
  }
}
