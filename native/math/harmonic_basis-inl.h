// Included inside a namespace, once by math/spherical_harmonics.h and once per instruction set by
// code whose T is a vector, hence no include guard.

/// Real spherical harmonics of degrees 0..4 in the order and signs that splat files use: index
/// l*l + l + m, m = -l..l, with the Condon-Shortley sign (-1)^m. Orthonormal on the sphere.
/// In: degree 0..4; x, y, z unit. Out: basis [(degree+1)^2].
/// Source: Ramamoorthi and Hanrahan, SIGGRAPH 2001 (degrees to 2); the same definition above.
template <typename T>
void harmonicBasis(int degree, T x, T y, T z, T* basis) {
  basis[0] = T(0.28209479177387814);
  if (degree < 1) return;
  const T c1 = T(0.48860251190291992);
  basis[1] = -c1 * y;
  basis[2] = c1 * z;
  basis[3] = -c1 * x;
  if (degree < 2) return;
  const T xx = x * x, yy = y * y, zz = z * z, xy = x * y, yz = y * z, xz = x * z;
  basis[4] = T(1.0925484305920792) * xy;
  basis[5] = T(-1.0925484305920792) * yz;
  basis[6] = T(0.31539156525252005) * (T(2) * zz - xx - yy);
  basis[7] = T(-1.0925484305920792) * xz;
  basis[8] = T(0.54627421529603959) * (xx - yy);
  if (degree < 3) return;
  basis[9] = T(-0.59004358992664352) * y * (T(3) * xx - yy);
  basis[10] = T(2.8906114426405538) * xy * z;
  basis[11] = T(-0.45704579946446577) * y * (T(4) * zz - xx - yy);
  basis[12] = T(0.3731763325901154) * z * (T(2) * zz - T(3) * xx - T(3) * yy);
  basis[13] = T(-0.45704579946446577) * x * (T(4) * zz - xx - yy);
  basis[14] = T(1.4453057213202769) * z * (xx - yy);
  basis[15] = T(-0.59004358992664352) * x * (xx - T(3) * yy);
  if (degree < 4) return;
  basis[16] = T(2.5033429417967046) * xy * (xx - yy);
  basis[17] = T(-1.7701307697799304) * yz * (T(3) * xx - yy);
  basis[18] = T(0.94617469575756008) * xy * (T(7) * zz - T(1));
  basis[19] = T(-0.66904654355728921) * yz * (T(7) * zz - T(3));
  basis[20] = T(0.10578554691520431) * (zz * (T(35) * zz - T(30)) + T(3));
  basis[21] = T(-0.66904654355728921) * xz * (T(7) * zz - T(3));
  basis[22] = T(0.47308734787878004) * (xx - yy) * (T(7) * zz - T(1));
  basis[23] = T(-1.7701307697799304) * xz * (xx - T(3) * yy);
  basis[24] = T(0.62583573544917614) * (xx * (xx - T(3) * yy) - yy * (T(3) * xx - yy));
}
