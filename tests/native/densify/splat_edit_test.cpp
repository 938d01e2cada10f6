#include "densify/splat_edit.h"

#include <gtest/gtest.h>

#include <random>

#include "base/parallel.h"

namespace stipple {
namespace {

RawSplats randomSplats(size_t count, uint32_t seed) {
  std::mt19937 random(seed);
  RawSplats splats;
  splats.sh_degree = 1;
  splats.extra_lengths = {2};
  splats.resize(count);
  for (size_t i = 0; i < arrayCount(splats); ++i) {
    for (float& value : arrayOf(splats, static_cast<RawArray>(i))) {
      value = static_cast<float>(random() % 100000);
    }
  }
  return splats;
}

std::vector<float> rowOf(const RawSplats& splats, size_t row) {
  std::vector<float> values;
  for (size_t i = 0; i < arrayCount(splats); ++i) {
    const RawArray array = static_cast<RawArray>(i);
    const size_t length = rowLength(splats, array);
    const float* begin = arrayOf(splats, array).data() + row * length;
    values.insert(values.end(), begin, begin + length);
  }
  return values;
}

void judgeKeep(const std::vector<uint32_t>& keep) {
  const RawSplats before = randomSplats(50, 1);
  RawSplats splats = before, moments = randomSplats(50, 2);
  const RawSplats moments_before = moments;
  SplatEdit edit;
  edit.keep = keep;
  edit.append = randomSplats(3, 3);
  validate(edit, splats);
  const EditTarget targets[] = {{&splats, false}, {&moments, true}};
  applyEdit(edit, targets);
  ASSERT_EQ(splats.size(), keep.size() + 3);
  ASSERT_EQ(moments.size(), keep.size() + 3);
  for (size_t i = 0; i < keep.size(); ++i) {
    EXPECT_EQ(rowOf(splats, i), rowOf(before, keep[i])) << i;
    EXPECT_EQ(rowOf(moments, i), rowOf(moments_before, keep[i])) << i;
  }
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(rowOf(splats, keep.size() + i), rowOf(edit.append, i));
    EXPECT_EQ(rowOf(moments, keep.size() + i),
              std::vector<float>(rowOf(edit.append, i).size(), 0.0f));
  }
}

TEST(SplatEdit, ListsThatRiseAndListsThatDoNotKeepTheirRows) {
  judgeKeep({0, 1, 2, 7, 8, 49});
  judgeKeep({49, 0, 12, 12, 3});
  judgeKeep({});
  std::vector<uint32_t> all(50), twice;
  for (uint32_t i = 0; i < 50; ++i) {
    all[i] = i;
    twice.insert(twice.end(), {i, i});
  }
  judgeKeep(all);
  judgeKeep(twice);  // more rows than before
}

TEST(SplatEdit, GivesTheSameForAnyNumberOfThreads) {
  SplatEdit edit;
  edit.keep.emplace();
  for (uint32_t i = 0; i < 20000; i += 1 + i % 3) edit.keep->push_back(i);
  edit.append = randomSplats(500, 4);
  RawSplats results[2];
  for (const unsigned threads : {1u, 2u}) {
    withThreads(threads, [&] {
      results[threads - 1] = randomSplats(20000, 5);
      const EditTarget target{&results[threads - 1], false};
      applyEdit(edit, {&target, 1});
    });
  }
  for (size_t row = 0; row < results[0].size(); row += 97) {
    EXPECT_EQ(rowOf(results[0], row), rowOf(results[1], row));
  }
  EXPECT_EQ(results[0].sh, results[1].sh);
}

TEST(SplatEdit, RowsOfGathersEveryArray) {
  const RawSplats splats = randomSplats(10, 6);
  const RawSplats chosen = rowsOf(splats, {9, 3, 3});
  ASSERT_EQ(chosen.size(), 3u);
  EXPECT_EQ(rowOf(chosen, 0), rowOf(splats, 9));
  EXPECT_EQ(rowOf(chosen, 2), rowOf(splats, 3));
  EXPECT_EQ(rowsOf(splats, {}).size(), 0u);
}

}  // namespace
}  // namespace stipple
