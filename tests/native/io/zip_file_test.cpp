#include "io/bytes/zip_file.h"

#include <gtest/gtest.h>

#include <string>

#include "scratch_folder.h"
#include "sog_scene.h"

namespace stipple {
namespace {

class Zip : public ScratchFolder {
 protected:
  std::string read(const std::string& archive, const std::string& name, uint64_t limit = 1 << 20) {
    const InputFile file(store("a.zip", archive));
    const std::vector<uint8_t> bytes = ZipReader(file).read(name, limit);
    return {bytes.begin(), bytes.end()};
  }
  void refused(const std::string& archive, std::initializer_list<const char*> texts,
               ErrorCode code = ErrorCode::kFormat) {
    expectError(code, texts, [&] { read(archive, "a"); });
  }
};

TEST_F(Zip, ReadsStoredAndDeflatedEntries) {
  const std::string large(200000, 'x');
  const std::string archive = ZipBytes()
                                  .add("a", "stored")
                                  .add("b/c", large, true)
                                  .add("empty", "")
                                  .add("empty, deflated", "", true)
                                  .text("a comment");
  EXPECT_EQ(read(archive, "a"), "stored");
  EXPECT_EQ(read(archive, "b/c"), large);
  EXPECT_EQ(read(archive, "empty"), "");
  EXPECT_EQ(read(archive, "empty, deflated"), "");
  expectError(ErrorCode::kFormat, {"a.zip", "no file 'd'"}, [&] { read(archive, "d"); });
}

TEST_F(Zip, ReadsBackWhatItWrites) {
  const auto write = [&](const std::string& name) {
    OutputFile file(path(name));
    ZipWriter zip(file);
    zip.add("meta.json", {'{', '}'});
    zip.add("b.webp", std::vector<uint8_t>(1000, 7));
    zip.finish();
    file.commit();
    return load(path(name));
  };
  const std::string archive = write("w.zip");
  EXPECT_EQ(archive, write("again.zip"));
  EXPECT_EQ(read(archive, "meta.json"), "{}");
  EXPECT_EQ(read(archive, "b.webp"), std::string(1000, '\7'));
}

TEST_F(Zip, RefusesNamesThatLeaveTheArchive) {
  for (const char* name : {"../a", "b/../../a", "/etc/passwd", "b\\..\\a", "C:a", "b/.."}) {
    SCOPED_TRACE(name);
    refused(ZipBytes().add("a", "x").add(name, "y").text(), {"a.zip", name, "'..'"});
  }
  EXPECT_EQ(read(ZipBytes().add("a..b", "x").text(), "a..b"), "x");
}

TEST_F(Zip, RefusesBombsBeforeUnpackingThem) {
  // 6 bytes of deflate data cannot become 4 GB, and 100 bytes are more than 99.
  refused(ZipBytes().add("a", "x", true, 0xfffffff0).text(), {"'a'", "4294967280", "cannot be"});
  refused(ZipBytes().add("a", "x", false, 2).text(), {"'a'", "cannot be"});
  const std::string archive = ZipBytes().add("a", std::string(100, 'x'), true).text();
  expectError(ErrorCode::kFormat, {"'a' of 100 bytes", "at most 99"},
              [&] { read(archive, "a", 99); });
}

TEST_F(Zip, NoticesDamage) {
  std::string archive = ZipBytes().add("a", "some bytes").text();
  archive[35] ^= 1;
  refused(archive, {"a.zip: a", "checksum"});
  archive = ZipBytes().add("a", "some bytes", true).text();
  archive[31] = 7;  // no such kind of deflate block
  refused(archive, {"a.zip: a", "deflate"});
  refused(ZipBytes().add("a", "some bytes", true, 9).text(), {"a.zip: a", "deflate"});
  refused(ZipBytes().add("a", "some bytes", true, 11).text(), {"a.zip: a", "gives 10 bytes"});
  archive = ZipBytes().add("a", "some bytes").text();
  archive[0] = 'Q';
  refused(archive, {"'a' at byte 0"});
  refused(ZipBytes().add("a", "x").add("a", "y").text(), {"two", "'a'"});
}

TEST_F(Zip, RefusesWhatItCannotRead) {
  std::string archive = ZipBytes().add("a", "x").text();
  const size_t directory = archive.find("PK\1\2");
  archive[directory + 8] = 1;
  refused(archive, {"'a'", "encrypted"}, ErrorCode::kUnsupported);
  archive[directory + 8] = 0;
  archive[directory + 10] = 93;
  refused(archive, {"'a'", "method 93"}, ErrorCode::kUnsupported);
  archive = ZipBytes().add("a", "x").text();
  archive.replace(archive.size() - 6, 4, "\xff\xff\xff\xff");
  refused(archive, {"64-bit", "4 GiB"}, ErrorCode::kUnsupported);
}

TEST_F(Zip, EveryTruncatedPrefixIsRefused) {
  const std::string archive = ZipBytes().add("a", "x").add("b", "some bytes", true).text();
  for (size_t length = 0; length < archive.size(); ++length) {
    refused(archive.substr(0, length), {"a.zip", "is not a whole zip archive"});
  }
}

TEST_F(Zip, AnyChangedByteIsAnErrorOrHarmless) {
  const std::string archive = ZipBytes().add("a", "x").add("b", "some bytes", true).text();
  for (size_t at = 0; at < archive.size(); ++at) {
    for (const int value : {0, 1, 0x7f, 0x80, 0xff}) {
      std::string changed = archive;
      changed[at] = static_cast<char>(value);
      try {
        EXPECT_EQ(read(changed, "b"), "some bytes") << "byte " << at << " = " << value;
      } catch (const Error&) {
      }
    }
  }
}

}  // namespace
}  // namespace stipple
