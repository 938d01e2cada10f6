// Included inside a namespace, once by cpu/back_projector_scalar.cpp and once per instruction set
// by cpu/back_projector_vector.cpp, hence no include guard. Needs there: loadLanes<T>(const
// double*), storeLanes(T, double* or float*), laneCount<T>(), loadGeometry and storeGradient of
// rows that follow each other, takeFootprintBack (projectBackwardSteps of the same namespace),
// sumHarmonicsBack and storeHarmonicsBack. One order of operations in double and nothing fused, so
// every instruction set gives the same bits.

constexpr size_t kMaxLanes = 8;

/// What goes into a block of splats, columns apart.
enum InColumn : size_t {
  kInPosition = 0,
  kInRotation = 3,
  kInScales = 7,
  kInOpacity = 10,
  kInS = 11,
  kInFirst = 12,
  kInSecond = 14,
  kInDepth = 17,
  kInCount = 18,
};

/// What comes out of it.
enum OutColumn : size_t {
  kOutPosition = 0,
  kOutRotation = 3,
  kOutScales = 7,
  kOutOpacity = 10,
  kOutMean = 11,
  kOutTurn = 13,
  kOutShift = 16,
  kOutCount = 19,
};

/// Harmonics of the lanes' directions, and what their derivatives need.
template <typename T>
struct DirectionLanes {
  T unit[3];
  T inverse_length;
};

/// Whether a block is a whole vector of rows that follow each other.
template <typename T>
bool areTogether(const SummedRows& rows, size_t first, size_t count) {
  return count == laneCount<T>() && rows.rows[first + count - 1] - rows.rows[first] == count - 1;
}

/// Of rows [first, first + count). Where they are together, geometry is loaded as vectors instead.
template <typename T>
void fillColumns(const PlacedCloud& placed, const SummedRows& rows, size_t first, size_t count,
                 double (*in)[kMaxLanes]) {
  const SplatCloud& cloud = *placed.cloud;
  const bool together = areTogether<T>(rows, first, count);
  for (size_t lane = 0; lane < laneCount<T>(); ++lane) {
    // Lanes behind the last splat repeat it.
    const size_t i = first + (lane < count ? lane : count - 1);
    const float* sum = rows.sumsOf(i);
    in[kInS][lane] = static_cast<double>(sum[kFieldS]);
    for (size_t k = 0; k < 2; ++k) in[kInFirst + k][lane] = static_cast<double>(sum[kFieldG0 + k]);
    for (size_t k = 0; k < 3; ++k) {
      in[kInSecond + k][lane] = static_cast<double>(sum[kFieldG00 + k]);
    }
    in[kInDepth][lane] = rows.depth_field ? static_cast<double>(sum[*rows.depth_field]) : 0.0;
    if (together) continue;
    const size_t row = rows.rows[i];
    for (size_t k = 0; k < 3; ++k) {
      in[kInPosition + k][lane] = static_cast<double>(cloud.positions[row * 3 + k]);
      in[kInScales + k][lane] = static_cast<double>(cloud.scales[row * 3 + k]);
    }
    for (size_t k = 0; k < 4; ++k) {
      in[kInRotation + k][lane] = static_cast<double>(cloud.rotations[row * 4 + k]);
    }
    in[kInOpacity][lane] = static_cast<double>(cloud.opacities[row]);
  }
}

/// Harmonics of a block's directions. A derivative by a coefficient is the product of two float32
/// numbers, which cannot leave its range: dL/dcolour is at most 1e4 times 2^32 pixels, and the
/// slope of the linearisation 2e17.
struct HarmonicColumns {
  alignas(64) double basis[25][kMaxLanes];
  alignas(64) float stored_basis[25][kMaxLanes];  ///< what derivatives are multiplied by
  alignas(64) double slopes[25][3][kMaxLanes];    ///< [coefficient][axis]
};

/// Colour of one lane. In: sh and by_colour of its row. Out: by_sum [3], by the sums of harmonics;
/// along [axis] by the viewing direction, kMaxLanes apart.
void sumHarmonicsBack(const PlacedCloud& placed, const HarmonicColumns& harmonics, size_t lane,
                      const float* sh, const float* by_colour, float* by_sum, double* along);

/// Writes the row of coefficients of one lane. In: by_sum [4], of which the last does not count.
void storeHarmonicsBack(const PlacedCloud& placed, const HarmonicColumns& harmonics, size_t lane,
                        const float* by_sum, float* by_sh);

/// Numbers that one splat after another writes into columns are loaded as vectors, which waits
/// until they have left the processor's store buffer, and everything that was stored before them,
/// such as rows of the result that are not in the cache yet. So there are two of these: one is
/// filled for the next block before this one is worked on.
struct BlockColumns {
  alignas(64) double in[kInCount][kMaxLanes];
};

constexpr size_t kLineFloats = 16;
/// Blocks from this one to the one whose harmonics are asked for.
constexpr size_t kBlocksAhead = 2;

template <typename T>
void directionSteps(const PlacedScene& scene, const PlacedCloud& placed, const T* position,
                    DirectionLanes<T>& direction, HarmonicColumns& columns) {
  using std::sqrt;
  T* d = direction.unit;
  for (int axis = 0; axis < 3; ++axis) {
    d[axis] = scene.view.perspective ? position[axis] - T(placed.eye[axis]) : T(placed.eye[axis]);
  }
  direction.inverse_length = T(1) / sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  for (int axis = 0; axis < 3; ++axis) d[axis] = d[axis] * direction.inverse_length;
  T values[25];
  T gradients[25][3];
  harmonicBasis(placed.sh_degree, d[0], d[1], d[2], values);
  harmonicBasisGradient(placed.sh_degree, d[0], d[1], d[2], gradients);
  const size_t coefficients = shCoefficientCount(placed.sh_degree);
  for (size_t k = 0; k < coefficients; ++k) {
    storeLanes(values[k], columns.basis[k]);
    storeLanes(values[k], columns.stored_basis[k]);
    for (size_t axis = 0; axis < 3; ++axis) {
      storeLanes(gradients[k][axis], columns.slopes[k][axis]);
    }
  }
}

/// Rows [first, first + count), at most laneCount<T>(), whose columns are filled.
template <typename T>
void takeBackBlock(const PlacedScene& scene, const PlacedCloud& placed, const Mat3d& normal_to_view,
                   const SummedRows& rows, size_t first, size_t count, const BlockColumns& filled,
                   SplatGradients& out, double* means, double* camera) {
  using std::max;
  using std::min;
  const auto& in = filled.in;
  const bool together = areTogether<T>(rows, first, count);
  SplatGeometry<T> splat;
  if (together) {
    loadGeometry(*placed.cloud, rows.rows[first], splat);
  } else {
    for (size_t k = 0; k < 3; ++k) {
      splat.position[k] = loadLanes<T>(in[kInPosition + k]);
      splat.scales[k] = loadLanes<T>(in[kInScales + k]);
    }
    for (size_t k = 0; k < 4; ++k) splat.rotation[k] = loadLanes<T>(in[kInRotation + k]);
    splat.opacity = loadLanes<T>(in[kInOpacity]);
  }
  splat.opacity = splat.opacity * T(placed.grade.opacity);
  FootprintGradient<T> by;
  // e = L d is sqrt(2 ln 2) g.
  by.s = loadLanes<T>(in[kInS]);
  const double scale = std::sqrt(kSquaredGScale);
  for (size_t k = 0; k < 2; ++k) by.first[k] = T(scale) * loadLanes<T>(in[kInFirst + k]);
  for (size_t k = 0; k < 3; ++k) by.second[k] = T(kSquaredGScale) * loadLanes<T>(in[kInSecond + k]);
  by.depth = loadLanes<T>(in[kInDepth]);
  T centre[3];
  placePoint(placed.linear, placed.translation, splat.position, centre);
  ProjectionGradient<T> gradient;
  takeFootprintBack(scene.view, placed.linear, centre, splat, placed.low_pass, by, gradient);

  const bool turns = placed.sh_degree > 0;
  HarmonicColumns harmonics;
  alignas(64) double along[3][kMaxLanes] = {};
  DirectionLanes<T> direction = {};
  if (turns) {
    directionSteps(scene, placed, splat.position, direction, harmonics);
  } else {
    storeLanes(T(static_cast<double>(kShC0)), harmonics.basis[0]);
    storeLanes(T(static_cast<double>(kShC0)), harmonics.stored_basis[0]);
  }
  const size_t stride = placed.cloud->shStride();
  alignas(64) float by_sums[kMaxLanes][4] = {};
  for (size_t lane = 0; lane < count; ++lane) {
    const size_t ahead = first + lane + kBlocksAhead * laneCount<T>();
    if (ahead < rows.count) {
      const size_t start = rows.rows[ahead] * stride;
      for (size_t i = 0; i < stride; i += kLineFloats) {
        __builtin_prefetch(&placed.cloud->sh[start + i]);
        __builtin_prefetch(&out.sh[start + i], 1);
      }
    }
    sumHarmonicsBack(placed, harmonics, lane, &placed.cloud->sh[rows.rows[first + lane] * stride],
                     rows.sumsOf(first + lane) + kFieldRed, by_sums[lane], &along[0][lane]);
  }
  const bool perspective = scene.view.perspective;
  if (turns) {
    T by_direction[3];
    for (size_t axis = 0; axis < 3; ++axis) by_direction[axis] = loadLanes<T>(along[axis]);
    const T* d = direction.unit;
    const T inward = d[0] * by_direction[0] + d[1] * by_direction[1] + d[2] * by_direction[2];
    for (int axis = 0; axis < 3; ++axis) {
      by_direction[axis] = (by_direction[axis] - d[axis] * inward) * direction.inverse_length;
    }
    T seen[3];
    for (int axis = 0; axis < 3; ++axis) {
      seen[axis] = T(normal_to_view(axis, 0)) * by_direction[0] +
                   T(normal_to_view(axis, 1)) * by_direction[1] +
                   T(normal_to_view(axis, 2)) * by_direction[2];
    }
    // A camera that moves by upsilon sees a splat at p from where p - upsilon was; a parallel view
    // that turns by omega looks along its z axis turned by -omega.
    if (perspective) {
      for (int axis = 0; axis < 3; ++axis) {
        gradient.position[axis] = gradient.position[axis] + by_direction[axis];
        gradient.centre[axis] = gradient.centre[axis] + seen[axis];
      }
    } else {
      gradient.turn[0] = gradient.turn[0] + seen[1];
      gradient.turn[1] = gradient.turn[1] - seen[0];
    }
  }

  alignas(64) double columns[kOutCount][kMaxLanes];
  const auto hold = [](T& value) {
    value = max(min(value, T(kLargestStored)), T(-kLargestStored));
  };
  for (size_t k = 0; k < 3; ++k) {
    hold(gradient.position[k]);
    hold(gradient.scales[k]);
    storeLanes(gradient.turn[k], columns[kOutTurn + k]);
    storeLanes(gradient.centre[k], columns[kOutShift + k]);
  }
  for (size_t k = 0; k < 4; ++k) hold(gradient.rotation[k]);
  gradient.opacity = gradient.opacity * T(placed.grade.opacity);
  hold(gradient.opacity);
  for (size_t k = 0; k < 2; ++k) {
    hold(gradient.mean[k]);
    storeLanes(gradient.mean[k], columns[kOutMean + k]);
  }
  if (together) {
    storeGradient(gradient, rows.rows[first], out);
  } else {
    for (size_t k = 0; k < 3; ++k) {
      storeLanes(gradient.position[k], columns[kOutPosition + k]);
      storeLanes(gradient.scales[k], columns[kOutScales + k]);
    }
    for (size_t k = 0; k < 4; ++k) storeLanes(gradient.rotation[k], columns[kOutRotation + k]);
    storeLanes(gradient.opacity, columns[kOutOpacity]);
  }
  for (size_t lane = 0; lane < count; ++lane) {
    const size_t row = rows.rows[first + lane];
    storeHarmonicsBack(placed, harmonics, lane, by_sums[lane], &out.sh[row * stride]);
    for (size_t k = 0; k < 2; ++k) means[lane * 2 + k] = columns[kOutMean + k][lane];
    for (size_t k = 0; k < 6; ++k) camera[k] += columns[kOutTurn + k][lane];
    if (together) continue;
    const auto value = [&](size_t column) { return static_cast<float>(columns[column][lane]); };
    for (size_t k = 0; k < 3; ++k) {
      out.positions[row * 3 + k] = value(kOutPosition + k);
      out.scales[row * 3 + k] = value(kOutScales + k);
    }
    for (size_t k = 0; k < 4; ++k) out.rotations[row * 4 + k] = value(kOutRotation + k);
    out.opacities[row] = value(kOutOpacity);
  }
}

template <typename T>
void takeBackRows(const PlacedScene& scene, const PlacedCloud& placed, const SummedRows& rows,
                  SplatGradients& out, double* means, double* camera) {
  const Mat3d normal_to_view = inverse(placed.linear).transpose();
  const size_t lanes = laneCount<T>();
  BlockColumns columns[2];
  const auto countFrom = [&](size_t first) { return std::min(lanes, rows.count - first); };
  if (rows.count > 0) fillColumns<T>(placed, rows, 0, countFrom(0), columns[0].in);
  for (size_t first = 0, block = 0; first < rows.count; first += lanes, ++block) {
    const size_t next = first + lanes;
    if (next < rows.count) {
      fillColumns<T>(placed, rows, next, countFrom(next), columns[(block + 1) % 2].in);
    }
    takeBackBlock<T>(scene, placed, normal_to_view, rows, first, countFrom(first),
                     columns[block % 2], out, means + first * 2, camera);
  }
}
