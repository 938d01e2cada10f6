#include "io/bytes/npy_array.h"

#include <gtest/gtest.h>

#include "npy_builder.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class NpyArrayTest : public ScratchFolder {
 protected:
  NpyArray read(const std::string& bytes) const { return readNpyArray(store("a.npy", bytes)); }
  std::string refusal(const std::string& bytes) const {
    try {
      read(bytes);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }
};

const std::vector<double> kSix = {1, 2, 3, 4, 5, 6.5};

TEST_F(NpyArrayTest, ReadsDoublesAndFloatsOfAllVersions) {
  for (const unsigned version : {1u, 2u, 3u}) {
    const NpyArray array = read(npyFile(npyHeader("<f8", false, "(2, 3)"), doubles(kSix), version));
    EXPECT_EQ(array.shape, (std::vector<uint64_t>{2, 3})) << version;
    EXPECT_EQ(array.values, kSix) << version;
  }
  const NpyArray floats_read =
      read(npyFile(npyHeader("<f4", false, "(6,)"), floats({1, 2, 3, 4, 5, 6.5f})));
  EXPECT_EQ(floats_read.shape, std::vector<uint64_t>{6});
  EXPECT_EQ(floats_read.values, kSix);
}

TEST_F(NpyArrayTest, BringsFortransOrderIntoRows) {
  const NpyArray array =
      read(npyFile(npyHeader("<f8", true, "(2, 3)"), doubles({1, 4, 2, 5, 3, 6.5})));
  EXPECT_EQ(array.values, kSix);
  // [2,2,2]: the first index is fastest in the file.
  const NpyArray cube =
      read(npyFile(npyHeader("<f8", true, "(2, 2, 2)"), doubles({0, 4, 2, 6, 1, 5, 3, 7})));
  EXPECT_EQ(cube.values, (std::vector<double>{0, 1, 2, 3, 4, 5, 6, 7}));
}

TEST_F(NpyArrayTest, ReadsOneNumberAndNone) {
  EXPECT_EQ(read(npyFile(npyHeader("<f8", false, "()"), doubles({7}))).values,
            std::vector<double>{7});
  EXPECT_TRUE(read(npyFile(npyHeader("<f8", false, "(0, 17)"), "")).values.empty());
}

TEST_F(NpyArrayTest, AcceptsOtherOrdersOfKeysAndQuotes) {
  const NpyArray array =
      read(npyFile("{\"shape\": (6,), 'descr': '<f8', \"fortran_order\": False}", doubles(kSix)));
  EXPECT_EQ(array.values, kSix);
}

TEST_F(NpyArrayTest, RefusesOtherTypesByName) {
  for (const char* type : {">f8", "<i8", "|O", "<c16", "<f2"}) {
    const std::string message = refusal(npyFile(npyHeader(type, false, "(6,)"), doubles(kSix)));
    EXPECT_NE(message.find("a.npy holds numbers of the type '" + std::string(type) +
                           "'; <f8 and <f4 are read"),
              std::string::npos)
        << message;
  }
  const std::string records = refusal(
      npyFile("{'descr': [('x', '<f8')], 'fortran_order': False, 'shape': (6,), }", doubles(kSix)));
  EXPECT_NE(records.find("holds records"), std::string::npos) << records;
}

TEST_F(NpyArrayTest, RefusesShapesThatAreNotOfTheFilesSize) {
  for (const char* shape : {"(7,)", "(5,)", "(2, 17)", "()", "(0,)", "(18446744073709551615, 2)",
                            "(4294967296, 4294967296)", "(6, 18446744073709551615, 0)"}) {
    const std::string message = refusal(npyFile(npyHeader("<f8", false, shape), doubles(kSix)));
    EXPECT_NE(message.find("and 48 bytes follow it"), std::string::npos) << shape << message;
  }
  const std::string beyond =
      refusal(npyFile(npyHeader("<f8", false, "(99999999999999999999,)"), doubles(kSix)));
  EXPECT_NE(beyond.find("beyond all measure"), std::string::npos) << beyond;
}

TEST_F(NpyArrayTest, RefusesDamagedHeadersInOneSentence) {
  for (const char* header :
       {"", "{", "{}", "{'descr': '<f8'}", "{'descr' '<f8'}", "{'descr': '<f8", "{'descr': <f8, }",
        "{'descr': '<f8', 'fortran_order': 0, 'shape': (6,), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (6, }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (-6,), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': 6, }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (6,), } x",
        "{'descr': '<f8', 'descr': '<f8', 'fortran_order': False, 'shape': (6,)}",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (6,), 'more': 1}",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (1,1,1,1,1,1,1,1,6)}"}) {
    const std::string message = refusal(npyFile(header, doubles(kSix)));
    EXPECT_NE(message.find("a.npy is a damaged .npy file: its header "), std::string::npos)
        << header << ": " << message;
  }
}

TEST_F(NpyArrayTest, RefusesEveryFileThatIsCutShort) {
  const std::string whole = npyFile(npyHeader("<f8", false, "(2, 3)"), doubles(kSix));
  for (size_t size = 0; size < whole.size(); ++size) {
    EXPECT_THROW(read(whole.substr(0, size)), Error) << size;
  }
  EXPECT_THROW(read(whole + "x"), Error);
}

TEST_F(NpyArrayTest, RefusesOtherFilesVersionsAndEndlessHeaders) {
  EXPECT_NE(refusal("PK\x03\x04 an archive of arrays").find("is not a .npy file"),
            std::string::npos);
  std::string other = npyFile(npyHeader("<f8", false, "(6,)"), doubles(kSix));
  other[6] = 4;
  EXPECT_NE(refusal(other).find("is of version 4"), std::string::npos);
  ByteText endless;
  endless.text("\x93NUMPY").u8(2).u8(0).u32(0xffffffffu).zeros(100);
  EXPECT_NE(refusal(endless.bytes).find("its header is said to have 4294967295 bytes"),
            std::string::npos);
  EXPECT_THROW(readNpyArray(path("none.npy")), Error);
}

}  // namespace
}  // namespace stipple
