// Included inside a namespace, once by math/spherical_harmonics_gradient.h and once per instruction
// set by code whose T is a vector, hence no include guard.

/// Derivatives of the polynomials of harmonicBasis by x, y and z. The polynomials are those of
/// harmonicBasis taken off the sphere too; only the part of a derivative that is tangent to the
/// sphere has a meaning of its own, so callers project onto it.
/// In: degree 0..4; x, y, z unit. Out: gradient [(degree+1)^2][3].
template <typename T>
void harmonicBasisGradient(int degree, T x, T y, T z, T (*gradient)[3]) {
  const auto set = [gradient](int index, T factor, T by_x, T by_y, T by_z) {
    gradient[index][0] = factor * by_x;
    gradient[index][1] = factor * by_y;
    gradient[index][2] = factor * by_z;
  };
  const T zero(0);
  set(0, zero, zero, zero, zero);
  if (degree < 1) return;
  const T c1 = T(0.48860251190291992);
  set(1, -c1, zero, T(1), zero);
  set(2, c1, zero, zero, T(1));
  set(3, -c1, T(1), zero, zero);
  if (degree < 2) return;
  const T xx = x * x, yy = y * y, zz = z * z, xy = x * y, yz = y * z, xz = x * z;
  const T c2 = T(1.0925484305920792);
  set(4, c2, y, x, zero);
  set(5, -c2, zero, z, y);
  set(6, T(0.31539156525252005), T(-2) * x, T(-2) * y, T(4) * z);
  set(7, -c2, z, zero, x);
  set(8, T(0.54627421529603959), T(2) * x, T(-2) * y, zero);
  if (degree < 3) return;
  const T c33 = T(-0.59004358992664352);
  const T c31 = T(-0.45704579946446577);
  set(9, c33, T(6) * xy, T(3) * (xx - yy), zero);
  set(10, T(2.8906114426405538), yz, xz, xy);
  set(11, c31, T(-2) * xy, T(4) * zz - xx - T(3) * yy, T(8) * yz);
  set(12, T(0.3731763325901154), T(-6) * xz, T(-6) * yz, T(6) * zz - T(3) * (xx + yy));
  set(13, c31, T(4) * zz - T(3) * xx - yy, T(-2) * xy, T(8) * xz);
  set(14, T(1.4453057213202769), T(2) * xz, T(-2) * yz, xx - yy);
  set(15, c33, T(3) * (xx - yy), T(-6) * xy, zero);
  if (degree < 4) return;
  const T c43 = T(-1.7701307697799304);
  const T c41 = T(-0.66904654355728921);
  const T seven = T(7) * zz;
  set(16, T(2.5033429417967046), y * (T(3) * xx - yy), x * (xx - T(3) * yy), zero);
  set(17, c43, T(6) * xy * z, T(3) * z * (xx - yy), y * (T(3) * xx - yy));
  set(18, T(0.94617469575756008), y * (seven - T(1)), x * (seven - T(1)), T(14) * xy * z);
  set(19, c41, zero, z * (seven - T(3)), y * (T(3) * seven - T(3)));
  set(20, T(0.10578554691520431), zero, zero, z * (T(20) * seven - T(60)));
  set(21, c41, z * (seven - T(3)), zero, x * (T(3) * seven - T(3)));
  set(22, T(0.47308734787878004), T(2) * x * (seven - T(1)), T(-2) * y * (seven - T(1)),
      T(14) * z * (xx - yy));
  set(23, c43, T(3) * z * (xx - yy), T(-6) * xy * z, x * (xx - T(3) * yy));
  set(24, T(0.62583573544917614), T(4) * x * (xx - T(3) * yy), T(4) * y * (yy - T(3) * xx), zero);
}
