#include "io/bytes/sha256.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "scratch_folder.h"

namespace stipple {
namespace {

std::string hashOf(const std::string& text) {
  Sha256 hash;
  hash.add(text.data(), text.size());
  return hash.finish();
}

// The values that sha256sum gives; the second and third are examples of FIPS 180-4.
TEST(Sha256, IsTheStandards) {
  EXPECT_EQ(hashOf(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(hashOf("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(hashOf("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(hashOf(std::string(1000000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Sha256, DoesNotDependOnThePieces) {
  std::string text;
  for (int i = 0; i < 203; ++i) text += static_cast<char>(i * 7);
  for (size_t piece = 1; piece <= text.size(); ++piece) {
    Sha256 hash;
    for (size_t at = 0; at < text.size(); at += piece) {
      hash.add(text.data() + at, std::min(piece, text.size() - at));
    }
    EXPECT_EQ(hash.finish(), hashOf(text)) << piece;
  }
}

class Sha256OfFile : public ScratchFolder {};

TEST_F(Sha256OfFile, FollowsAFileThatChanges) {
  const std::string file = store("a.bin", "abc");
  EXPECT_EQ(sha256OfFile(file), hashOf("abc"));
  store("a.bin", "abcd");
  EXPECT_EQ(sha256OfFile(file), hashOf("abcd"));
  // The same size at another time.
  store("a.bin", "abce");
  std::filesystem::last_write_time(
      file, std::filesystem::last_write_time(file) + std::chrono::seconds(5));
  EXPECT_EQ(sha256OfFile(file), hashOf("abce"));
}

TEST_F(Sha256OfFile, StopsWhenCancelled) {
  const std::string file = store("a.bin", std::string(3 << 20, 'x'));
  Progress progress;
  progress.cancel();
  expectError(ErrorCode::kCancelled, {}, [&] { sha256OfFile(file, &progress); });
  EXPECT_EQ(sha256OfFile(file), hashOf(std::string(3 << 20, 'x')));
}

TEST_F(Sha256OfFile, RefusesAFileThatIsNotThere) {
  expectError(ErrorCode::kIo, {"nothing.bin"}, [&] { sha256OfFile(path("nothing.bin")); });
}

}  // namespace
}  // namespace stipple
