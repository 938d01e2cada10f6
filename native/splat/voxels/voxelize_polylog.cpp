// Based on: Wood, The computation of polylogarithms, University of Kent, 1992, equation 9.3.
#include "splat/voxels/voxelize_polylog.h"

#include <cmath>
#include <iterator>
#include <numbers>

namespace stipple {

namespace {

// zeta(1/2 - k) / k!, evaluated with 40 digits.
constexpr double kZetaOverFactorial[] = {
    -1.4603545088095868129,     -0.20788622497735456602,    -0.012742600944916517975,
    0.0014194881296417217571,   0.00018504213897830966494,  -0.00002576391039346528204,
    -3.7103583609711452764e-6,  5.4499363879699776953e-7,   8.107737035218799657e-8,
    -1.2169402758501129322e-8,  -1.838671818911662466e-9,   2.792338682946231696e-10,
    4.2582276793945556874e-11,  -6.5159518145811522599e-12, -9.9996518291720372089e-13,
    1.538410894234388499e-13,   2.3719170462859145444e-14,  -3.6639733309701700059e-15,
    -5.669396174932969e-16,     8.7856617595804491557e-17,  1.3633235401269985379e-17,
    -2.1181342613544374958e-18, -3.2944985641392370827e-19, 5.1293708538972937063e-20,
    7.9935709418998762726e-21,  -1.2467719755164659169e-21};

// Below this z the power series is the faster of the two: 27 terms leave 0.25^27 = 6e-17.
constexpr double kSeriesLimit = 0.25;
constexpr int kSeriesTerms = 27;

}  // namespace

double polylogHalf(double z) {
  if (z <= 0.0) return 0.0;
  if (z < kSeriesLimit) {
    double sum = 0.0;
    for (int k = kSeriesTerms; k >= 1; --k) sum = sum * z + 1.0 / std::sqrt(static_cast<double>(k));
    return sum * z;
  }
  // |mu| <= 1.39, so the last term kept is below 1e-17.
  const double mu = std::log(z);
  double sum = 0.0;
  for (int k = static_cast<int>(std::size(kZetaOverFactorial)) - 1; k >= 0; --k) {
    sum = sum * mu + kZetaOverFactorial[k];
  }
  return std::sqrt(std::numbers::pi / -mu) + sum;
}

}  // namespace stipple
