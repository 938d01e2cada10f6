// One merge of two nodes that move, with lanes along the times. T is double, or a vector of doubles
// that looks like one, with every operation rounded by itself; sums over the times have the same
// order for all: all instances give the same bits. Included inside the namespace of the instance
// after merge_steps-inl.h; beside what that needs, it has beforehand: kLanes (1, 2, 4 or 8),
// loadLanes<T> of kLanes floats or doubles, storeLanes, and wholeLogarithm (of base 2, rounded
// down) and mantissa (1 to 2) of normal numbers above 0.

/// A sum over the times: eight of them side by side, then those in order.
template <class T>
class TimeSum {
 public:
  void add(size_t first, T value) {
    T& part = parts_[first / kLanes % kParts];
    part = part + value;
  }
  double total() const {
    alignas(64) double values[kMergeTimeGroup];
    for (size_t k = 0; k < kParts; ++k) storeLanes(parts_[k], values + k * kLanes);
    return ((values[0] + values[4]) + (values[2] + values[6])) +
           ((values[1] + values[5]) + (values[3] + values[7]));
  }

 private:
  static constexpr size_t kParts = kMergeTimeGroup / kLanes;
  T parts_[kParts] = {};
};

/// ln(x), x > 0 and normal; the series ends at an error of 1e-9.
template <class T>
T logarithm(T x) {
  const T m = mantissa(x);
  const auto is_high = m > T(std::numbers::sqrt2);
  const T z = pick(is_high, T(0.5) * m, m);
  const T n = wholeLogarithm(x) + pick(is_high, T(1.0), T(0.0));
  const T s = (z - T(1.0)) / (z + T(1.0));
  const T q = s * s;
  T sum = T(1.0 / 9) * q + T(1.0 / 7);
  sum = sum * q + T(1.0 / 5);
  sum = sum * q + T(1.0 / 3);
  sum = sum * q + T(1.0);
  return n * T(std::numbers::ln2) + T(2.0) * s * sum;
}

/// stretchedOffset() of times.
template <class T>
T offsetOf(const TimeWindow& window, T time, double centre) {
  if (window.half <= 0) return time - T(centre);
  const double whole = 2 * window.half;
  const double begin = std::clamp(centre - window.half, 0.0, 1 - whole);
  const T inside = min(max(time, T(begin)), T(begin + whole));
  return (inside - T(centre)) * T(window.near) + (time - inside) * T(window.far);
}

/// Rotation matrix of the quaternion 1 + offset * turn, row by row; none where it has no direction.
template <class T>
void turnMatrix(const std::array<double, 4>& turn, T offset, T* matrix) {
  const T w = T(1.0) + offset * T(turn[0]);
  const T x = offset * T(turn[1]);
  const T y = offset * T(turn[2]);
  const T z = offset * T(turn[3]);
  const T squared = (w * w + x * x) + (y * y + z * z);
  const T scale = pick(squared > T(kNoRotation * kNoRotation),
                       T(2.0) / max(squared, T(kNoRotation * kNoRotation)), T(0.0));
  matrix[0] = T(1.0) - scale * (y * y + z * z);
  matrix[1] = scale * (x * y - w * z);
  matrix[2] = scale * (x * z + w * y);
  matrix[3] = scale * (x * y + w * z);
  matrix[4] = T(1.0) - scale * (x * x + z * z);
  matrix[5] = scale * (y * z - w * x);
  matrix[6] = scale * (x * z - w * y);
  matrix[7] = scale * (y * z + w * x);
  matrix[8] = T(1.0) - scale * (x * x + y * y);
}

/// M C M^T of a symmetric matrix xx xy xz yy yz zz. Step: 3 for rows of M, 1 for its columns.
template <class T>
std::array<T, 6> turned(const std::array<T, 6>& c, const T* m, bool transposed) {
  const size_t row = transposed ? 1 : 3, column = transposed ? 3 : 1;
  T half[9];
  for (size_t i = 0; i < 3; ++i) {
    const T a = m[i * row], b = m[i * row + column], d = m[i * row + 2 * column];
    half[3 * i] = (a * c[0] + b * c[1]) + d * c[2];
    half[3 * i + 1] = (a * c[1] + b * c[3]) + d * c[4];
    half[3 * i + 2] = (a * c[2] + b * c[4]) + d * c[5];
  }
  const auto entry = [&](size_t i, size_t j) {
    return (half[3 * i] * m[j * row] + half[3 * i + 1] * m[j * row + column]) +
           half[3 * i + 2] * m[j * row + 2 * column];
  };
  return {entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)};
}

/// What a node has at all times alike, as MergeValues.
template <class T>
MergeValues<T> constantsOf(const MovingNode& node) {
  MergeValues<T> values;
  for (size_t c = 0; c < 3; ++c) {
    values.colour[c] = T(node.colour[c]);
    values.around[c] = T(node.around[c]);
  }
  values.visibility = T(node.visibility);
  values.contrast = T(node.contrast);
  values.weight = T(node.weight);
  values.inflation = T(node.inflation);
  values.leaf_area = T(node.leaf_area);
  return values;
}

/// The rest, at the times from `first` on.
template <class T>
void loadTimes(const float* samples, size_t stride, size_t first, MergeValues<T>& values) {
  const auto load = [&](size_t field) { return loadLanes<T>(samples + field * stride + first); };
  for (size_t k = 0; k < 3; ++k) values.mean[k] = load(MovingField::kMean + k);
  values.opacity = load(MovingField::kOpacity);
  values.area = load(MovingField::kArea);
  for (size_t k = 0; k < 6; ++k) values.covariance[k] = load(MovingField::kCovariance + k);
  for (size_t k = 0; k < 3; ++k) values.plane_size[k] = load(MovingField::kPlanes + k);
  values.depth = load(MovingField::kDepth);
}

/// Numbers of a merge at the times while it is made.
struct TimeRows {
  alignas(64) double mean[3][kMostMergeTimes];
  alignas(64) double covariance[6][kMostMergeTimes];
  alignas(64) double depth[kMostMergeTimes];
  alignas(64) double offset[kMostMergeTimes];
  alignas(64) double opacity[kMostMergeTimes];
};

/// Moments of the mixture at every time. The covariance that is drawn is the mean of what is seen
/// of it, in the frame that turns with the node.
template <class T>
void mixTimes(const MovingScale& scale, const MovingNode& a, const float* a_samples,
              const MovingNode& b, const float* b_samples, MovingNode& node, TimeRows& rows) {
  const bool turns = node.turn != std::array<double, 4>{};
  MergeValues<T> va = constantsOf<T>(a), vb = constantsOf<T>(b), mixed;
  TimeSum<T> shapes[6], even[6], depths;
  T matrix[9];
  for (size_t first = 0; first < scale.stride; first += kLanes) {
    loadTimes(a_samples, scale.stride, first, va);
    loadTimes(b_samples, scale.stride, first, vb);
    mixMoments(va, vb, mixed);
    const T offset = offsetOf(scale.window, loadLanes<T>(scale.parts.data() + first), node.centre);
    storeLanes(offset, rows.offset + first);
    for (size_t k = 0; k < 3; ++k) storeLanes(mixed.mean[k], rows.mean[k] + first);
    storeLanes(mixed.depth, rows.depth + first);
    const T weight = loadLanes<T>(scale.weights.data() + first);
    if (turns) {
      turnMatrix(node.turn, offset, matrix);
      mixed.covariance = turned(mixed.covariance, matrix, true);
    }
    depths.add(first, weight * mixed.depth);
    for (size_t k = 0; k < 6; ++k) {
      shapes[k].add(first, weight * mixed.depth * mixed.covariance[k]);
      even[k].add(first, weight * mixed.covariance[k]);
    }
  }
  const double depth = depths.total();
  for (size_t k = 0; k < 6; ++k) {
    node.shape[k] = depth > kLeastDepth ? shapes[k].total() / depth : even[k].total();
  }
  std::array<T, 6> shape;
  for (size_t k = 0; k < 6; ++k) shape[k] = T(node.shape[k]);
  for (size_t first = 0; first < scale.stride; first += kLanes) {
    std::array<T, 6> covariance = shape;
    if (turns) {
      turnMatrix(node.turn, loadLanes<T>(rows.offset + first), matrix);
      covariance = turned(shape, matrix, false);
    }
    for (size_t k = 0; k < 6; ++k) storeLanes(covariance[k], rows.covariance[k] + first);
  }
}

/// Sums over the times on one side of the moment, for the fit of ln O = ln peak - rate offset^2.
template <class T>
struct LifeSums {
  TimeSum<T> w, wl, wx, wxx, wxl;
  void add(size_t first, T weight, T x, T l) {
    w.add(first, weight);
    wl.add(first, weight * l);
    wx.add(first, weight * x);
    wxx.add(first, weight * x * x);
    wxl.add(first, weight * x * l);
  }
};

/// Rates of the opacities in rows by least squares of their logarithms, weighted by their squares,
/// towards rates `before` where the times do not tell.
template <class T>
std::array<double, 2> fittedRates(const MovingScale& scale, const TimeRows& rows,
                                  const std::array<double, 2>& before) {
  LifeSums<T> sums[2];
  for (size_t first = 0; first < scale.stride; first += kLanes) {
    const T opacity = loadLanes<T>(rows.opacity + first);
    const T offset = loadLanes<T>(rows.offset + first);
    const T weight = loadLanes<T>(scale.weights.data() + first) * opacity * opacity;
    const T l = logarithm(max(opacity, T(kLeastShownOpacity)));
    const T x = offset * offset;
    const auto is_before = T(0.0) > offset;
    sums[0].add(first, pick(is_before, weight, T(0.0)), x, l);
    sums[1].add(first, pick(is_before, T(0.0), weight), x, l);
  }
  const double part = 0.5 * scale.window.near / static_cast<double>(scale.times);
  double w[2], x[2], q[2], m[2];
  double total = 0, heights = 0, slopes = 0;
  for (size_t side = 0; side < 2; ++side) {
    w[side] = sums[side].w.total();
    total += w[side];
  }
  if (!(total > kLeastDepth)) return before;
  const double pull = kRatePull * part * part * part * part * total;
  for (size_t side = 0; side < 2; ++side) {
    x[side] = sums[side].wx.total();
    q[side] = sums[side].wxx.total() + pull;
    m[side] = sums[side].wxl.total() - pull * before[side];
    heights += sums[side].wl.total() - m[side] * x[side] / q[side];
    slopes += w[side] - x[side] * x[side] / q[side];
  }
  std::array<double, 2> rates;
  const double largest = 1 / (scale.shortest_life * scale.shortest_life + scale.broadening);
  const double smallest = 1 / (kLargestLifespan * kLargestLifespan + scale.broadening);
  if (!(slopes > kLeastSlope * total)) return before;
  const double height = heights / slopes;
  for (size_t side = 0; side < 2; ++side) {
    const double rate = (height * x[side] - m[side]) / q[side];
    rates[side] = std::clamp(rate, std::min(smallest, largest), largest);
  }
  return rates;
}

/// Fills areas, the inflation and the opacities that a row can have, nearest to those that the
/// depth asks for. Out: areas [stride].
template <class T>
void drawTimes(const MovingScale& scale, const std::array<double, 2>& before, MovingNode& node,
               TimeRows& rows, double* areas) {
  MergeValues<T> values = constantsOf<T>(node);
  const T footprint(scale.space.footprint);
  TimeSum<T> inflations, depths;
  for (size_t first = 0; first < scale.stride; first += kLanes) {
    for (size_t k = 0; k < 6; ++k) values.covariance[k] = loadLanes<T>(rows.covariance[k] + first);
    values.depth = loadLanes<T>(rows.depth + first);
    measureArea(values, footprint);
    storeLanes(values.area, areas + first);
    const T weight = loadLanes<T>(scale.weights.data() + first) * values.depth;
    depths.add(first, weight);
    inflations.add(first, weight * inflationOf(values));
  }
  const double depth = depths.total();
  node.inflation = depth > kLeastDepth ? inflations.total() / depth : 1;
  const T inflation(node.inflation);
  for (size_t first = 0; first < scale.stride; first += kLanes) {
    const T area = loadLanes<T>(areas + first);
    storeLanes(opacityByTable(loadLanes<T>(rows.depth + first) / (area * inflation)),
               rows.opacity + first);
  }
  node.rates = fittedRates<T>(scale, rows, before);
  TimeSum<T> mixed, own;
  for (size_t first = 0; first < scale.stride; first += kLanes) {
    const T offset = loadLanes<T>(rows.offset + first);
    const T rate = pick(T(0.0) > offset, T(node.rates[0]), T(node.rates[1]));
    const T share = expNegative(T(0.0) - rate * (offset * offset));
    const T weight = loadLanes<T>(scale.weights.data() + first);
    mixed.add(first, weight * share * loadLanes<T>(rows.opacity + first));
    own.add(first, weight * share * share);
    storeLanes(share, rows.opacity + first);
  }
  const double shares = own.total();
  node.peak = shares > kLeastDepth ? std::min(mixed.total() / shares, kMergeMaxOpacity) : 0;
  for (size_t first = 0; first < scale.stride; first += kLanes) {
    const T opacity = T(node.peak) * loadLanes<T>(rows.opacity + first);
    storeLanes(pick(opacity > T(kLeastShownOpacity), opacity, T(0.0)), rows.opacity + first);
  }
}

/// The merge of two nodes. In: means [3, stride], or null. Out: samples
/// [MovingField::kCount, stride], or null. Returns: its error.
template <class T>
double mergeOverTime(const MovingScale& scale, const MovingNode& a, const float* a_samples,
                     const MovingNode& b, const float* b_samples, const double* means,
                     MovingNode& node, float* samples) {
  std::array<double, 2> before;
  node = mixedConstants(a, b, scale, before);
  TimeRows rows;
  alignas(64) double areas[kMostMergeTimes];
  mixTimes<T>(scale, a, a_samples, b, b_samples, node, rows);
  drawTimes<T>(scale, before, node, rows, areas);

  MergeValues<T> va = constantsOf<T>(a), vb = constantsOf<T>(b), vm = constantsOf<T>(node);
  const T footprint(scale.space.footprint);
  alignas(64) double out[kLanes];
  const auto put = [&](size_t field, size_t first, T value) {
    storeLanes(value, out);
    for (size_t k = 0; k < kLanes; ++k) {
      samples[field * scale.stride + first + k] = static_cast<float>(out[k]);
    }
  };
  TimeSum<T> errors;
  for (size_t first = 0; first < scale.stride; first += kLanes) {
    loadTimes(a_samples, scale.stride, first, va);
    loadTimes(b_samples, scale.stride, first, vb);
    for (size_t k = 0; k < 3; ++k) {
      vm.mean[k] = loadLanes<T>(means ? means + k * scale.stride + first : rows.mean[k] + first);
    }
    for (size_t k = 0; k < 6; ++k) vm.covariance[k] = loadLanes<T>(rows.covariance[k] + first);
    vm.opacity = loadLanes<T>(rows.opacity + first);
    measurePlanes(vm, footprint);
    errors.add(first,
               loadLanes<T>(scale.weights.data() + first) * errorOfMerge(va, vb, vm, footprint));
    if (!samples) continue;
    for (size_t k = 0; k < 3; ++k) put(MovingField::kMean + k, first, vm.mean[k]);
    put(MovingField::kOpacity, first, vm.opacity);
    put(MovingField::kArea, first, loadLanes<T>(areas + first));
    for (size_t k = 0; k < 6; ++k) put(MovingField::kCovariance + k, first, vm.covariance[k]);
    for (size_t k = 0; k < 3; ++k) put(MovingField::kPlanes + k, first, vm.plane_size[k]);
    put(MovingField::kDepth, first, loadLanes<T>(rows.depth + first));
  }
  return errors.total();
}

/// MovingMergeKernel::costs.
template <class T>
void costsOverTime(const MovingNodeRows& rows, uint32_t slot, const uint32_t* others, size_t count,
                   float* costs) {
  constexpr double kLargest = std::numeric_limits<float>::max();
  MovingNode node;
  for (size_t i = 0; i < count; ++i) {
    const double error =
        mergeOverTime<T>(*rows.scale, rows.nodes[slot], rows.samplesOf(slot), rows.nodes[others[i]],
                         rows.samplesOf(others[i]), nullptr, node, nullptr);
    costs[i] = static_cast<float>(std::min(error, kLargest));
  }
}

/// MovingMergeKernel::merge.
template <class T>
void mergeRowsOverTime(const MovingNodeRows& rows, uint32_t a, uint32_t b, const double* means,
                       MovingMerge& merged) {
  merged.error = mergeOverTime<T>(*rows.scale, rows.nodes[a], rows.samplesOf(a), rows.nodes[b],
                                  rows.samplesOf(b), means, merged.node, merged.samples.data());
}
