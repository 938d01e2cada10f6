#include "model/model_kinds.h"

#include <gtest/gtest.h>
#include <stipple/stipple.h>

#include <set>
#include <string>

#include "io/bytes/safetensors.h"
#include "io/scratch_folder.h"

namespace stipple {
namespace {

using ModelKinds = ScratchFolder;

TEST_F(ModelKinds, HaveTheNumbersOfTheHeader) {
  EXPECT_EQ(modelKind("surface").number, static_cast<uint32_t>(STIPPLE_MODEL_SURFACE));
  EXPECT_EQ(modelKind("hierarchy").number, static_cast<uint32_t>(STIPPLE_MODEL_HIERARCHY));
  EXPECT_EQ(modelKind("field").number, static_cast<uint32_t>(STIPPLE_MODEL_FIELD));
  EXPECT_EQ(modelKind("latent").number, static_cast<uint32_t>(STIPPLE_MODEL_LATENT));
  EXPECT_EQ(modelKind("motion").number, static_cast<uint32_t>(STIPPLE_MODEL_MOTION));
  EXPECT_EQ(modelKind("scaffold").number, static_cast<uint32_t>(STIPPLE_MODEL_SCAFFOLD));
  EXPECT_EQ(modelKind("relay").number, static_cast<uint32_t>(STIPPLE_MODEL_RELAY));
}

TEST_F(ModelKinds, HaveNamesAndNumbersOfTheirOwn) {
  std::set<std::string> names;
  std::set<uint32_t> numbers;
  for (const ModelKind& kind : modelKinds()) {
    EXPECT_TRUE(names.insert(kind.name).second) << kind.name;
    EXPECT_TRUE(numbers.insert(kind.number).second) << kind.name;
    EXPECT_NE(kind.read, nullptr);
  }
}

TEST_F(ModelKinds, ReadersRefuseAssetsOfAnotherKind) {
  SafeTensorsWriter file;
  setAssetKind(file, "nothing");
  file.write(path("nothing"));
  for (const ModelKind& kind : modelKinds()) {
    expectError(ErrorCode::kUnsupported, {kind.name, "'nothing'"},
                [&] { kind.read(path("nothing"), {}); });
  }
}

TEST_F(ModelKinds, ThatNobodyKnowsAreRefusedWithThoseThatCanBeRead) {
  SafeTensorsWriter file;
  setAssetKind(file, "later");
  file.write(path("later"));
  expectError(ErrorCode::kUnsupported,
              {"'later'", "'surface', 'hierarchy', 'field', 'latent', 'motion', 'scaffold', 'relay'"},
              [&] { loadModel(path("later")); });
}

}  // namespace
}  // namespace stipple
