// Included inside a namespace, once by splat/render/projection.h and once per instruction set by
// cpu/projector_vector.cpp, hence no include guard.
//
// These steps take no decision and have one order of operations: T is a number, or a vector of
// numbers whose lanes then get the same bits. A lane that shows nothing may hold any finite result.

/// Room for rounding in every bound of where a splat shows, pixels. Bounds only save work: a pixel
/// inside them is still decided by splatAlpha.
template <typename T>
T boundMargin(T bound) {
  using std::abs;
  return T(0.01) + T(1e-7) * abs(bound);
}

/// In: rows x and y of A [3]; deviation = sqrt(variance).
template <typename T>
CovarianceFactor<T> factoriseRows(const T* x, const T* y, T deviation) {
  using std::sqrt;
  CovarianceFactor<T> factor;
  factor.r00 = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + deviation * deviation);
  const T inverse = T(1) / pick(factor.r00 > T(0), factor.r00, T(1));
  const T u[4] = {x[0] * inverse, x[1] * inverse, x[2] * inverse, deviation * inverse};
  factor.r01 = u[0] * y[0] + u[1] * y[1] + u[2] * y[2];
  const T v[4] = {y[0] - factor.r01 * u[0], y[1] - factor.r01 * u[1], y[2] - factor.r01 * u[2],
                  factor.r01 * u[3]};
  factor.r11 = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + v[3] * v[3] + deviation * deviation);
  return factor;
}

/// Object to view. S is the number type of T.
template <typename T, typename S>
void placePoint(const Eigen::Matrix<S, 3, 3>& linear, const Eigen::Matrix<S, 3, 1>& translation,
                const T* point, T* out) {
  for (int i = 0; i < 3; ++i) {
    out[i] = T(linear(i, 0)) * point[0] + T(linear(i, 1)) * point[1] + T(linear(i, 2)) * point[2] +
             T(translation[i]);
  }
}

/// Columns: axes times standard deviations, as scaledAxes. Out: axes [row][column].
template <typename T>
void scaledAxesSteps(const T* rotation, const T* scales, T (&axes)[3][3]) {
  using std::abs;
  using std::max;
  // Dividing by the largest component first keeps the squares inside the range of T.
  const T largest =
      max(max(abs(rotation[0]), abs(rotation[1])), max(abs(rotation[2]), abs(rotation[3])));
  const T inverse = T(1) / largest;
  const T w = rotation[0] * inverse, x = rotation[1] * inverse;
  const T y = rotation[2] * inverse, z = rotation[3] * inverse;
  const T s = T(2) / (w * w + x * x + y * y + z * z);
  axes[0][0] = (T(1) - s * (y * y + z * z)) * scales[0];
  axes[0][1] = s * (x * y - w * z) * scales[1];
  axes[0][2] = s * (x * z + w * y) * scales[2];
  axes[1][0] = s * (x * y + w * z) * scales[0];
  axes[1][1] = (T(1) - s * (x * x + z * z)) * scales[1];
  axes[1][2] = s * (y * z - w * x) * scales[2];
  axes[2][0] = s * (x * z - w * y) * scales[0];
  axes[2][1] = s * (y * z + w * x) * scales[1];
  axes[2][2] = (T(1) - s * (x * x + y * y)) * scales[2];
}

/// Footprint, half sides and depth of a splat whose centre lies between near and far. Returns the
/// narrower of r00 and r11, to be held against kMinWidth; where that or the opacity is too small,
/// the rest means nothing. In: centre [3] view space.
template <typename T, typename S>
T projectSteps(const View<S>& view, const Eigen::Matrix<S, 3, 3>& linear, const T* centre,
               const SplatGeometry<T>& splat, LowPass low_pass, Projected<T>& out) {
  using std::log;
  using std::max;
  using std::min;
  using std::sqrt;
  T own[3][3];
  scaledAxesSteps(splat.rotation, splat.scales, own);
  T axes[3][3];
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      axes[i][k] =
          T(linear(i, 0)) * own[0][k] + T(linear(i, 1)) * own[1][k] + T(linear(i, 2)) * own[2][k];
    }
  }
  T a[2][3];
  Footprint<T>& footprint = out.footprint;
  if (view.perspective) {
    const T inverse_z = T(1) / centre[2];
    const T slope_x = centre[0] * inverse_z;
    const T slope_y = centre[1] * inverse_z;
    footprint.mean_x = T(view.fx) * slope_x + T(view.cx);
    footprint.mean_y = T(view.fy) * slope_y + T(view.cy);
    const T held_x = min(max(slope_x, T(view.slope_min[0])), T(view.slope_max[0]));
    const T held_y = min(max(slope_y, T(view.slope_min[1])), T(view.slope_max[1]));
    for (int k = 0; k < 3; ++k) {
      a[0][k] = T(view.fx) * inverse_z * (axes[0][k] - held_x * axes[2][k]);
      a[1][k] = T(view.fy) * inverse_z * (axes[1][k] - held_y * axes[2][k]);
    }
  } else {
    footprint.mean_x = T(view.fx) * centre[0] + T(view.cx);
    footprint.mean_y = T(view.fy) * centre[1] + T(view.cy);
    for (int k = 0; k < 3; ++k) {
      a[0][k] = T(view.fx) * axes[0][k];
      a[1][k] = T(view.fy) * axes[1][k];
    }
  }

  const S deviation = std::sqrt(lowPassVariance<S>(low_pass));
  const CovarianceFactor<T> factor = factoriseRows(a[0], a[1], T(deviation));
  const T narrowest = min(factor.r00, factor.r11);
  const auto wide = narrowest > T(S(kMinWidth));
  const T inverse_r00 = T(1) / pick(wide, factor.r00, T(1));
  const T inverse_r11 = T(1) / pick(wide, factor.r11, T(1));
  footprint.opacity = splat.opacity;
  if (low_pass == LowPass::kMip) {
    const CovarianceFactor<T> sharp = factoriseRows(a[0], a[1], T(0));
    footprint.opacity = footprint.opacity * ((sharp.r00 * inverse_r00) * (sharp.r11 * inverse_r11));
  }
  footprint.l00 = inverse_r00;
  footprint.l11 = inverse_r11;
  footprint.l10 = T(0) - factor.r01 * inverse_r00 * inverse_r11;

  // q/2 <= ln(o / least) is an ellipse; its half sides are sqrt(2 ln(o / least)) standard
  // deviations.
  const T least = T(view.least_alpha);
  const T reach = sqrt(T(2) * log(max(footprint.opacity, least) / least));
  const T sigma_y = sqrt(factor.r01 * factor.r01 + factor.r11 * factor.r11);
  out.half_x = reach * factor.r00 + boundMargin(reach * factor.r00);
  out.half_y = reach * sigma_y + boundMargin(reach * sigma_y);
  out.depth = centre[2];
  return narrowest;
}
