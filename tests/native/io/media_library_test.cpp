#include "io/media_library.h"

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "io/bytes/compression.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "io/volume_file.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

namespace fs = std::filesystem;

class MediaLibrary : public ScratchFolder {
 protected:
  /// True in the copy of this program that `passesAlone` starts in a folder of its own.
  static bool isAlone() { return std::getenv(kAlone) != nullptr; }
  /// Runs the test of this name once more, in a copy of the program in the scratch folder.
  void passesAlone(const std::string& test) {
    fs::copy_file("/proc/self/exe", path("alone"), fs::copy_options::overwrite_existing);
    const std::string command = std::string(kAlone) + "=1 " + path("alone") +
                                " --gtest_filter=MediaLibrary." + test + " > " + path("log") +
                                " 2>&1";
    const int status = std::system(command.c_str());
    const std::string log = load(path("log"));
    EXPECT_NE(log.find("[  PASSED  ] 1 test"), std::string::npos) << log;
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << log;
  }

  static constexpr char kAlone[] = "STIPPLE_TEST_ALONE";
};

TEST_F(MediaLibrary, IsFoundBesideTheProgram) {
  EXPECT_EQ(mediaTable().version, kMediaTableVersion);
  EXPECT_EQ(&mediaTable(), &mediaTable());
  EXPECT_EQ(packingTable().version, kPackingTableVersion);
}

TEST_F(MediaLibrary, IsUnavailableWhereItIsNotInstalled) {
  if (!isAlone()) return passesAlone("IsUnavailableWhereItIsNotInstalled");
  Image image;
  image.width = image.height = image.channels = 1;
  image.pixels = {0.5f};
  const auto unavailable = [](const auto& work) {
    expectError(ErrorCode::kUnavailable, {"libstipple_media.so", "No such file"}, work);
  };
  unavailable([&] { writeImageFile(image, path("a.png")); });
  unavailable([&] { readImageFile(store("b.png", "b")); });
  unavailable([&] { readMeshFile(store("b.glb", "b")); });
  unavailable([&] { readVolumeFile(store("b.vdb", "b")); });
  SparseVolume volume;
  volume.voxel_size = 1;
  unavailable([&] { writeVolumeFile(volume, path("a.vdb")); });
  EXPECT_FALSE(fs::exists(path("a.png")));
  EXPECT_FALSE(fs::exists(path("a.vdb")));
  expectError(ErrorCode::kUnavailable,
              {"libstipple_packing.so", "packs and unpacks splats", "No such file"},
              [] { packingTable(); });
}

TEST_F(MediaLibrary, IsNotNeededToUnpackSplats) {
  if (!isAlone()) {
    const std::string library = "libstipple_packing.so";
    fs::copy_file(fs::read_symlink("/proc/self/exe").parent_path().parent_path() / "lib" / library,
                  path(library));
    return passesAlone("IsNotNeededToUnpackSplats");
  }
  const std::string text = "a line of text";
  const auto* bytes = reinterpret_cast<const uint8_t*>(text.data());
  for (const Compression compression : {Compression::kGzip, Compression::kZstd}) {
    const ByteVector packed = packBytes(compression, bytes, text.size(), 6, "text");
    std::string whole(text.size(), '\0');
    EXPECT_EQ(unpackBytes(compression, packed.data(), packed.size(),
                          reinterpret_cast<uint8_t*>(whole.data()), whole.size(), "text"),
              text.size());
    EXPECT_EQ(whole, text);
  }
  expectError(ErrorCode::kUnavailable, {"libstipple_media.so"}, [] { mediaTable(); });
}

TEST_F(MediaLibrary, IsUnavailableWhereItIsDamaged) {
  if (!isAlone()) {
    store("libstipple_media.so", "not a library");
    return passesAlone("IsUnavailableWhereItIsDamaged");
  }
  for (int attempt = 0; attempt < 2; ++attempt) {
    expectError(ErrorCode::kUnavailable, {"libstipple_media.so", "file too short"},
                [] { mediaTable(); });
  }
}

TEST_F(MediaLibrary, ThrowsWhatACallReports) {
  expectError(ErrorCode::kUnsupported, {"the reason"}, [] {
    callMedia([](StippleMediaStatus* status) {
      status->code = static_cast<int32_t>(ErrorCode::kUnsupported);
      std::snprintf(status->message, sizeof(status->message), "the reason");
    });
  });
}

}  // namespace
}  // namespace stipple
