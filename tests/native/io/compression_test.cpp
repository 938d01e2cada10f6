#include "io/bytes/compression.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

std::vector<uint8_t> someBytes(size_t count) {
  std::mt19937 random(5);
  std::vector<uint8_t> bytes(count);
  for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random() % 17);
  return bytes;
}

class CompressionOf : public ::testing::TestWithParam<Compression> {};

TEST_P(CompressionOf, GivesEveryByteBack) {
  for (const size_t count : {size_t{0}, size_t{1}, size_t{1000}, size_t{3000000}}) {
    const std::vector<uint8_t> bytes = someBytes(count);
    const ByteVector packed = packBytes(GetParam(), bytes.data(), count, 6, "a");
    std::vector<uint8_t> back(count + 1, 255);
    ASSERT_EQ(unpackBytes(GetParam(), packed.data(), packed.size(), back.data(), count + 1, "a"),
              count);
    back.resize(count);
    EXPECT_EQ(back, bytes);
  }
}

TEST_P(CompressionOf, GivesTheSameBytesForAnyNumberOfThreads) {
  const std::vector<uint8_t> bytes = someBytes(3000000);
  const auto packed = [&] { return packBytes(GetParam(), bytes.data(), bytes.size(), 6, "a"); };
  ByteVector one;
  withThreads(1, [&] { one = packed(); });
  EXPECT_EQ(packed(), one);
  // 17 equally likely values hold 4.09 bits each, of which the packers miss half a bit.
  EXPECT_LT(one.size(), bytes.size() * 60 / 100);
}

TEST_P(CompressionOf, StopsWhereTheCallersRoomEnds) {
  // A megabyte of zeros in a kilobyte: the reader takes no more than it asked for.
  const std::vector<uint8_t> zeros(size_t{1} << 20, 0);
  const ByteVector packed = packBytes(GetParam(), zeros.data(), zeros.size(), 9, "bomb");
  ASSERT_LT(packed.size(), 4096u);
  std::vector<uint8_t> room(1000, 7);
  EXPECT_EQ(unpackBytes(GetParam(), packed.data(), packed.size(), room.data(), 900, "bomb"), 900u);
  EXPECT_EQ(room[899], 0);
  EXPECT_EQ(room[900], 7);
}

TEST_P(CompressionOf, RefusesEveryTruncatedStream) {
  const std::vector<uint8_t> bytes = someBytes(300);
  const ByteVector packed = packBytes(GetParam(), bytes.data(), bytes.size(), 6, "a");
  std::vector<uint8_t> room(301);
  for (size_t size = 0; size < packed.size(); ++size) {
    expectError(ErrorCode::kFormat, {"the file"}, [&] {
      unpackBytes(GetParam(), packed.data(), size, room.data(), room.size(), "the file");
    });
  }
}

TEST_P(CompressionOf, RefusesBytesOfAnotherKind) {
  const std::vector<uint8_t> bytes = someBytes(64);
  std::vector<uint8_t> room(100);
  expectError(ErrorCode::kFormat, {"the file", "64 bytes"}, [&] {
    unpackBytes(GetParam(), bytes.data(), bytes.size(), room.data(), room.size(), "the file");
  });
}

INSTANTIATE_TEST_SUITE_P(Both, CompressionOf,
                         ::testing::Values(Compression::kGzip, Compression::kZstd),
                         [](const auto& which) {
                           return which.param == Compression::kGzip ? "Gzip" : "Zstd";
                         });

}  // namespace
}  // namespace stipple
