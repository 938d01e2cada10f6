// What merge_steps-inl.h and moving_steps-inl.h ask of plain doubles. Included inside an unnamed
// namespace.

using std::max;
using std::min;
using std::sqrt;

double pick(bool condition, double yes, double no) {
  return condition ? yes : no;
}
double wholePart(double value) {
  return std::floor(value);
}
double powerOfTwo(double n) {
  return std::bit_cast<double>(static_cast<uint64_t>(static_cast<int64_t>(n) + 1023) << 52);
}
double rootGuess(double x) {
  return std::bit_cast<double>(kRootGuess - (std::bit_cast<uint64_t>(x) >> 1));
}
void opacityEnds(double piece, double* ends) {
  std::copy_n(&opacityTable().ends[2 * static_cast<size_t>(piece)], 4, ends);
}

constexpr size_t kLanes = 1;

template <class T>
double loadLanes(const float* values) {
  return static_cast<double>(*values);
}
template <class T>
double loadLanes(const double* values) {
  return *values;
}
[[maybe_unused]] void storeLanes(double value, double* values) {
  *values = value;
}

[[maybe_unused]] double wholeLogarithm(double x) {
  return static_cast<double>(static_cast<int64_t>(std::bit_cast<uint64_t>(x) >> 52) - 1023);
}
[[maybe_unused]] double mantissa(double x) {
  return std::bit_cast<double>((std::bit_cast<uint64_t>(x) & kMantissaBits) | kBitsOfOne);
}
