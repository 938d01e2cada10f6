#include "nn/matrix_backend.h"

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "io/scratch_folder.h"
#include "nn/onednn_backend.h"
#include "test_numbers.h"

namespace stipple {
namespace {

namespace fs = std::filesystem;

class MatrixBackends : public ScratchFolder {
 protected:
  /// The names of the backends, the default one first, in a copy of this program that runs in a
  /// folder of its own with `environment`; or what it fails with.
  std::string namesIn(const std::string& environment) const {
    return saidIn(environment, "SayTheirNames");
  }
  /// What a test of such a copy writes.
  std::string saidIn(const std::string& environment, const std::string& test) const {
    fs::copy_file("/proc/self/exe", path("alone"), fs::copy_options::overwrite_existing);
    // What this program itself is told does not count.
    const std::string command =
        "STIPPLE_MATRIX_BACKEND= " + environment + " " + kAlone + "=" + path("names") + " " +
        path("alone") + " --gtest_filter=MatrixBackends." + test + " > " + path("log") + " 2>&1";
    const int status = std::system(command.c_str());
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << load(path("log"));
    return load(path("names"));
  }
  static constexpr char kAlone[] = "STIPPLE_TEST_ALONE";
};

TEST_F(MatrixBackends, SayTheirNames) {
  const char* file = std::getenv(kAlone);
  std::string names;
  try {
    names = defaultMatrixBackend().name();
    for (const MatrixBackend* backend : matrixBackends()) {
      names += " ";
      names += backend->name();
      EXPECT_FALSE(backend->instructionSets().empty());
    }
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    names = error.what();
  }
  if (file != nullptr) std::ofstream(file) << names;
}

TEST_F(MatrixBackends, AreOursAloneWhereTheLibraryIsMissingOrDamaged) {
  EXPECT_EQ(namesIn(""), "highway highway");
  store("libstipple_nn.so", "not a library");
  EXPECT_EQ(namesIn(""), "highway highway");
}

TEST_F(MatrixBackends, AreChosenByTheEnvironment) {
  EXPECT_EQ(namesIn("STIPPLE_MATRIX_BACKEND=highway"), "highway highway");
  const std::string refused = namesIn("STIPPLE_MATRIX_BACKEND=abacus");
  EXPECT_NE(refused.find("\"abacus\"; this machine has highway"), std::string::npos) << refused;
  std::string why;
  if (onednnBackend(&why) == nullptr) GTEST_SKIP() << "libstipple_nn.so cannot be loaded: " << why;
  fs::create_symlink(
      fs::read_symlink("/proc/self/exe").parent_path().parent_path() / "lib" / "libstipple_nn.so",
      path("libstipple_nn.so"));
  EXPECT_EQ(namesIn(""), "onednn highway onednn");
  EXPECT_EQ(namesIn("STIPPLE_MATRIX_BACKEND=highway"), "highway highway onednn");
  EXPECT_EQ(namesIn("STIPPLE_MATRIX_BACKEND=onednn"), "onednn highway onednn");
}

TEST_F(MatrixBackends, SayWhyTheyHaveNoBfloat16) {
  const char* file = std::getenv(kAlone);
  std::string said = "it has them";
  try {
    requirePrecision(FactorPrecision::kFloat32);
    requirePrecision(FactorPrecision::kBfloat16);
    EXPECT_TRUE(defaultMatrixBackend().has(FactorPrecision::kBfloat16));
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kUnavailable);
    said = error.what();
  }
  if (file != nullptr) {
    std::ofstream(file) << said;
    return;
  }
  const std::string without = saidIn("", "SayWhyTheyHaveNoBfloat16");
  EXPECT_NE(without.find("not to be had here, because oneDNN cannot be loaded: "),
            std::string::npos)
      << without;
  std::string why;
  if (onednnBackend(&why) == nullptr) GTEST_SKIP() << "libstipple_nn.so cannot be loaded: " << why;
  fs::create_symlink(
      fs::read_symlink("/proc/self/exe").parent_path().parent_path() / "lib" / "libstipple_nn.so",
      path("libstipple_nn.so"));
  const std::string named = saidIn("STIPPLE_MATRIX_BACKEND=highway", "SayWhyTheyHaveNoBfloat16");
  EXPECT_NE(named.find("because STIPPLE_MATRIX_BACKEND is \"highway\""), std::string::npos)
      << named;
  const std::string limited = saidIn("ONEDNN_MAX_CPU_ISA=AVX2", "SayWhyTheyHaveNoBfloat16");
  EXPECT_NE(limited.find("AVX512_BF16; oneDNN uses avx2"), std::string::npos) << limited;
}

size_t threadCount() {
  size_t count = 0;
  for (const auto& entry : fs::directory_iterator("/proc/self/task")) count += entry.exists();
  return count;
}

TEST_F(MatrixBackends, WorkOnTheCallingThreadAlone) {
  const size_t inputs = 1024, outputs = 256, rows = 192;
  const WeightTable table =
      TableBuilder().add("w", {outputs, inputs}, numbers(outputs * inputs, 1)).table();
  const std::vector<float> in = numbers(rows * inputs, 2);
  std::vector<float> out(rows * outputs);
  for (const MatrixBackend* backend : matrixBackends()) {
    for (const FactorPrecision precision :
         {FactorPrecision::kFloat32, FactorPrecision::kBfloat16}) {
      if (!backend->has(precision)) continue;
      const size_t before = threadCount();
      std::vector<float> packed(backend->packedSize(inputs, outputs, precision) + 16);
      // At a cache line, as layers have it.
      auto* line =
          reinterpret_cast<float*>((reinterpret_cast<uintptr_t>(packed.data()) + 63) / 64 * 64);
      backend->pack(table.require("w", {outputs, inputs}), inputs, 0, outputs, precision, line);
      LinearPanel panel;
      panel.rows = rows;
      panel.inputs = inputs;
      panel.outputs = outputs;
      panel.in = in.data();
      panel.in_stride = inputs;
      panel.out = out.data();
      panel.out_stride = outputs;
      backend->multiply(panel, line, precision);
      EXPECT_EQ(threadCount(), before) << backend->name();
    }
  }
}

}  // namespace
}  // namespace stipple
