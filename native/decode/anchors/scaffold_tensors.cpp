#include "decode/anchors/scaffold_tensors.h"

#include <vector>

#include "base/error.h"

namespace stipple {

TensorTable tensorsOfScaffold(const ScaffoldParameters& scaffold) {
  TensorTable table;
  forEachScaffoldArray(
      scaffold, [&](const std::string& name, const std::vector<float>& values, size_t width) {
        Tensor tensor{{values.size() / width}, values};
        if (width > 1) tensor.shape.push_back(width);
        table[name] = std::move(tensor);
      });
  return table;
}

ScaffoldParameters scaffoldOfTensors(const TensorTable& table, const ScaffoldShape& like) {
  ScaffoldParameters scaffold = makeScaffold(like);
  forEachScaffoldArray(
      scaffold, [&](const std::string& name, std::vector<float>& values, size_t width) {
        const auto found = table.find(name);
        const auto* stored =
            found == table.end() ? nullptr : std::get_if<std::vector<float>>(&found->second.values);
        if (stored == nullptr || stored->size() % width != 0) {
          fail(ErrorCode::kFormat, "the scaffold has no tensor " + name +
                                       " of float32 in rows of " + std::to_string(width));
        }
        // Networks have their sizes from the shape; anchors are as many as there are.
        const bool is_of_network = !values.empty();
        if (is_of_network && values.size() != stored->size()) {
          fail(ErrorCode::kFormat, "tensor " + name + " of the scaffold has " +
                                       std::to_string(stored->size()) + " values; " +
                                       std::to_string(values.size()) + " are needed");
        }
        values = *stored;
      });
  validate(scaffold);
  return scaffold;
}

}  // namespace stipple
