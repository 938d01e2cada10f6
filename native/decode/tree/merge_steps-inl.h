// The moments and the error of one merge. T is double, or a vector of doubles that looks like one,
// with every operation rounded by itself: all instances give the same bits. Included inside the
// namespace of the instance, which has beforehand: sqrt, min, max, pick(condition, yes, no),
// wholePart (floor), powerOfTwo (of a whole number, -64..0), rootGuess and opacityEnds, all for T.

/// Variance of a coordinate plane after the low-pass, times the other axis', less the covariance
/// squared. Of a needle, rounding would leave anything of xx yy - xy^2: below 0 it is 0, what the
/// blur adds stays.
template <class T>
T blurredDeterminant(T xx, T xy, T yy, T blur) {
  return max(max(xx * yy - xy * xy, T(0.0)) + blur * (xx + yy + blur), T(kSmallestDeterminant));
}

/// 1 / sqrt(x) of a normal number above 0, by Newton's steps from rootGuess: a relative error of
/// 2e-3 after the first, 5e-6, 3e-11 after the third. A root and a division take five times as
/// long.
template <class T>
T inverseRoot(T x) {
  const T half = T(0.5) * x;
  T y = rootGuess(x);
  for (int step = 0; step < 3; ++step) y = y * (T(1.5) - half * y * y);
  return y;
}

/// exp(x) for x <= 0, 0 below kLeastExponent. The reduced argument is within ln 2 / 2 of 0; the
/// series ends at a relative error of 1e-9.
template <class T>
T expNegative(T x) {
  const auto is_seen = x > T(kLeastExponent);
  const T bounded = pick(is_seen, x, T(0.0));
  const T n = wholePart(bounded * T(1.4426950408889634) + T(0.5));
  const T r = bounded - n * T(0.6931471805599453);
  T sum = T(1.0) + r * T(1.0 / 7) * (T(1.0) + r * T(1.0 / 8));
  sum = T(1.0) + r * T(1.0 / 6) * sum;
  sum = T(1.0) + r * T(1.0 / 5) * sum;
  sum = T(1.0) + r * T(1.0 / 4) * sum;
  sum = T(1.0) + r * T(1.0 / 3) * sum;
  sum = T(1.0) + r * T(1.0 / 2) * sum;
  sum = T(1.0) + r * sum;
  return pick(is_seen, sum * powerOfTwo(n), T(0.0));
}

/// Opacity of an optical depth, at most kMergeMaxOpacity, by the table.
template <class T>
T opacityByTable(T depth) {
  const T x = min(max(depth, T(0.0)), T(kLargestDepth)) * T(1 / OpacityTable::kStep);
  const T piece = min(wholePart(x), T(double{OpacityTable::kPieces - 1}));
  T ends[4];
  opacityEnds(piece, ends);
  const T t = x - piece;
  const T s = T(1.0) - t;
  const T opacity = s * s * (T(1.0) + T(2.0) * t) * ends[0] +
                    t * t * (T(1.0) + T(2.0) * s) * ends[2] +
                    T(OpacityTable::kStep) * t * s * (s * ends[1] - t * ends[3]);
  return min(opacity, T(kMergeMaxOpacity));
}

/// The same of a node's covariance times a factor.
template <class T>
T planeDeterminant(const MergeValues<T>& node, size_t plane, T factor, T blur) {
  const size_t* entries = kPlaneEntries[plane];
  return blurredDeterminant(factor * node.covariance[entries[0]],
                            factor * node.covariance[entries[1]],
                            factor * node.covariance[entries[2]], blur);
}

/// Fills the area, which follows from the covariance.
template <class T>
void measureArea(MergeValues<T>& node, T footprint) {
  T squares = T(0.0);
  for (size_t plane = 0; plane < 3; ++plane) {
    squares = squares + planeDeterminant(node, plane, T(1.0), footprint);
  }
  // The sum of the squared areas over three orthogonal directions is the same for all of them.
  node.area = sqrt(squares * T(1.0 / 3));
}

/// Fills the plane sizes, which follow from the covariance and the inflation.
template <class T>
void measurePlanes(MergeValues<T>& node, T footprint) {
  for (size_t plane = 0; plane < 3; ++plane) {
    const T determinant = planeDeterminant(node, plane, node.inflation, footprint);
    node.plane_size[plane] = determinant * inverseRoot(determinant);
  }
}

/// The moments of a mixture, and the sum of what both cover. Both nodes count alike: exchanging
/// them changes no bit.
template <class T>
void mixMoments(const MergeValues<T>& a, const MergeValues<T>& b, MergeValues<T>& node) {
  node.weight = a.weight + b.weight;
  const auto has_weight = node.weight > T(0.0);
  const T inverse_weight = T(1.0) / pick(has_weight, node.weight, T(1.0));
  const T share_a = pick(has_weight, a.weight * inverse_weight, T(0.5));
  const T share_b = pick(has_weight, b.weight * inverse_weight, T(0.5));
  T apart[3];
  for (size_t axis = 0; axis < 3; ++axis) {
    node.mean[axis] = share_a * a.mean[axis] + share_b * b.mean[axis];
    apart[axis] = a.mean[axis] - b.mean[axis];
    node.colour[axis] = share_a * a.colour[axis] + share_b * b.colour[axis];
  }
  const T spread = share_a * share_b;
  for (size_t i = 0; i < 6; ++i) {
    const size_t row = i < 3 ? 0 : i < 5 ? 1 : 2;
    const size_t column = i < 3 ? i : i < 5 ? i - 2 : 2;
    node.covariance[i] = share_a * a.covariance[i] + share_b * b.covariance[i] +
                         spread * (apart[row] * apart[column]);
  }
  node.leaf_area = share_a * a.leaf_area + share_b * b.leaf_area;
  node.visibility = share_a * a.visibility + share_b * b.visibility;
  node.contrast = share_a * a.contrast + share_b * b.contrast;
  // What stands behind the others adds to the coverage only as far as it is seen beside them.
  const T inverse_seen = T(1.0) / pick(node.visibility > T(0.0), node.visibility, T(1.0));
  const T seen_a = pick(node.visibility > a.visibility, a.visibility * inverse_seen, T(1.0));
  const T seen_b = pick(node.visibility > b.visibility, b.visibility * inverse_seen, T(1.0));
  node.depth = seen_a * a.depth + seen_b * b.depth;
}

/// How much larger than its moments a node with its area and its depth is drawn.
template <class T>
T inflationOf(const MergeValues<T>& node) {
  // 0 where all leaves lie in one place, near 1 where the area is that between them.
  const T spacing = max(T(1.0) - node.leaf_area / node.area, T(0.0));
  const T open = min(node.visibility * T(1 / kFullInflationVisibility), T(1.0));
  const T surplus = max(node.depth / (T(kLargestDepth) * node.area), T(1.0));
  return T(1.0) + open * (min(T(1.0) + spacing * spacing, surplus) - T(1.0));
}

/// mergedNode.
template <class T>
void mergeMoments(const MergeValues<T>& a, const MergeValues<T>& b, T footprint,
                  MergeValues<T>& node) {
  mixMoments(a, b, node);
  measureArea(node, footprint);
  node.inflation = inflationOf(node);
  node.opacity = opacityByTable(node.depth / (node.area * node.inflation));
  measurePlanes(node, footprint);
}

template <class T>
T dotColours(const MergeValues<T>& a, const MergeValues<T>& b, const T* behind) {
  T sum = T(kCoverageShare);
  for (size_t c = 0; c < 3; ++c) {
    sum = sum + (a.colour[c] - behind[c]) * (b.colour[c] - behind[c]);
  }
  return sum;
}

/// Integral of the product of two Gaussians of mass 2 pi over a coordinate plane, through the
/// low-pass, over 2 pi.
template <class T>
T planeProduct(const MergeValues<T>& a, const MergeValues<T>& b, size_t plane, T footprint) {
  const size_t* entries = kPlaneEntries[plane];
  const auto sum = [&](size_t entry) {
    return a.inflation * a.covariance[entry] + b.inflation * b.covariance[entry];
  };
  const T xx = sum(entries[0]);
  const T xy = sum(entries[1]);
  const T yy = sum(entries[2]);
  const T blur = footprint + footprint;
  const T inverse_root = inverseRoot(blurredDeterminant(xx, xy, yy, blur));
  const T dx = a.mean[kPlaneAxes[plane][0]] - b.mean[kPlaneAxes[plane][0]];
  const T dy = a.mean[kPlaneAxes[plane][1]] - b.mean[kPlaneAxes[plane][1]];
  const T squared = ((yy + blur) * dx * dx - T(2.0) * xy * dx * dy + (xx + blur) * dy * dy) *
                    inverse_root * inverse_root;
  // Along a needle rounding may leave less than 0.
  return expNegative(T(-0.5) * max(squared, T(0.0))) * inverse_root;
}

/// mergeError. Both nodes count alike, here too.
template <class T>
T errorOfMerge(const MergeValues<T>& a, const MergeValues<T>& b, const MergeValues<T>& merged,
               T footprint) {
  T behind[3];
  for (size_t c = 0; c < 3; ++c) behind[c] = T(0.5) * (a.around[c] + b.around[c]);
  const T aa = dotColours(a, a, behind);
  const T bb = dotColours(b, b, behind);
  const T mm = dotColours(merged, merged, behind);
  const T ab = dotColours(a, b, behind);
  const T am = dotColours(a, merged, behind);
  const T bm = dotColours(b, merged, behind);
  const T seen_a = a.contrast * a.opacity;
  const T seen_b = b.contrast * b.opacity;
  const T seen_m = merged.contrast * merged.opacity;
  T error = T(0.0);
  for (size_t plane = 0; plane < 3; ++plane) {
    const T in_a = seen_a * a.plane_size[plane];
    const T in_b = seen_b * b.plane_size[plane];
    const T in_m = seen_m * merged.plane_size[plane];
    // The square of a Gaussian is one of half the variance: a quarter of the determinant's root.
    const T own = seen_a * in_a * aa + seen_b * in_b * bb + seen_m * in_m * mm;
    const T mixed = in_a * in_b * ab * planeProduct(a, b, plane, footprint) -
                    (in_a * in_m * am * planeProduct(a, merged, plane, footprint) +
                     in_b * in_m * bm * planeProduct(b, merged, plane, footprint));
    error = error + (own + T(4.0) * mixed);
  }
  return max(error, T(0.0)) * T(std::numbers::pi);
}
