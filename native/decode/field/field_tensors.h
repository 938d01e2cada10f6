#pragma once

#include "data/tensor_table.h"
#include "decode/field/field_parameters.h"

namespace stipple {

/// What a field has learned, as named tensors: "field.features.levelL", "field.details.levelL",
/// "field.network.layerI.weights" and ".biases".
TensorTable tensorsOfField(const FieldParameters& field);

/// The other way round. In: like: everything that is no tensor. Errors: kFormat for tensors that
/// are missing, of another type, or do not fit together.
FieldParameters fieldOfTensors(const TensorTable& table, const FieldParameters& like);

}  // namespace stipple
