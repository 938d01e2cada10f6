// The integers, sums and hashes are those of torch.quasirandom.SobolEngine(3, scramble=True,
// seed=123), recorded with PyTorch.
#include "generate/sobol_points.h"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <set>
#include <utility>
#include <vector>

#include "base/error.h"
#include "io/bytes/safetensors.h"
#include "io/bytes/sha256.h"

namespace stipple {
namespace {

using Point = std::array<uint32_t, 3>;

TEST(SobolPoints, AreTheRecordedIntegers) {
  const std::vector<Point> points = sobolIntegers(8192);
  const std::vector<std::pair<size_t, Point>> recorded = {
      {0, {96906626, 623962702, 437811466}},    {1, {826824837, 264454735, 687405417}},
      {2, {680324849, 822214226, 44019868}},    {3, {469900278, 468866643, 813641983}},
      {1023, {97990296, 465877637, 741812146}}, {4095, {96601366, 339870294, 89341396}},
      {8191, {96849785, 218113063, 686557315}}};
  for (const auto& [index, point] : recorded) EXPECT_EQ(points[index], point) << "point " << index;
}

TEST(SobolPoints, SumUpToTheRecordedNumber) {
  uint64_t sum = 0;
  for (const Point& point : sobolIntegers(8192)) sum += uint64_t{point[0]} + point[1] + point[2];
  EXPECT_EQ(sum, 13194139521024u);
}

TEST(SobolPoints, HaveTheRecordedHashes) {
  static_assert(std::endian::native == std::endian::little);
  Sha256 integers, floats;
  const std::vector<Point> points = sobolIntegers(8192);
  integers.add(points.data(), points.size() * sizeof(Point));
  EXPECT_EQ(integers.finish(), "383caa6ce58408ce82c4a8eacc4f1e6b00de03939468133579afff0bc031f54e");
  const std::vector<float> numbers = sobolPoints(8192);
  floats.add(numbers.data(), numbers.size() * sizeof(float));
  EXPECT_EQ(floats.finish(), "884df4db664a680c100d032c9855397ced6afa28f8984efbee6b77f6ba3efe6b");
}

TEST(SobolPoints, AreTheFloatsThatARecordedRunUsed) {
  const SafeTensorsReader file(STIPPLE_TEST_DATA "/networks/deg_pipeline_a.safetensors");
  const Tensor recorded = file.readTensor("expect.sobol");
  EXPECT_EQ(std::get<std::vector<float>>(recorded.values), sobolPoints(64));
}

TEST(SobolPoints, OfASmallerCountAreTheFirstOfALargerOne) {
  const std::vector<float> many = sobolPoints(1000);
  const std::vector<float> few = sobolPoints(100);
  EXPECT_TRUE(std::equal(few.begin(), few.end(), many.begin()));
  EXPECT_TRUE(sobolPoints(0).empty());
}

TEST(SobolPoints, PutOnePointIntoEachSliceOfAPowerOfTwo) {
  const std::vector<Point> points = sobolIntegers(4096);
  for (size_t d = 0; d < 3; ++d) {
    std::set<uint32_t> slices;
    for (const Point& point : points) slices.insert(point[d] >> (kSobolBits - 12));
    EXPECT_EQ(slices.size(), 4096u) << "axis " << d;
  }
}

TEST(SobolPoints, RefuseMoreThanThereAre) {
  try {
    sobolPoints(kMostSobolPoints + 1);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    EXPECT_STREQ(error.what(), "1073741825 Sobol points are asked for; there are 1073741824");
  }
}

}  // namespace
}  // namespace stipple
