#pragma once

#include <map>
#include <string>

#include "data/latent.h"
#include "data/tensor_table.h"
#include "data/weight_table.h"

namespace stipple {

/// Maps a safetensors file of a network's weights into memory; nothing is read before it is used.
/// Errors: kIo; kFormat for a file that is not one, or whose tensors lie outside it or on each
/// other. Out: metadata: the texts that the file carries, where they are wanted.
WeightTable openWeightFile(const std::string& path,
                           std::map<std::string, std::string>* metadata = nullptr);

/// What a file of weights that was trained here says in its metadata, by this key.
constexpr char kTrainedKey[] = "stipple_training";

/// And by this one where it kept the encoder of another training: what that one's file says.
constexpr char kLatentsKey[] = "stipple_latents";
/// The training whose encoder the latents are of, which files that fit together have in common;
/// empty of weights that were not trained here.
std::string latentsOf(const std::map<std::string, std::string>& metadata);

/// Writes weights that were trained here, with metadata kTrainedKey: the settings of the training,
/// as JSON, and kLatentsKey where that is given. Errors: kIo; kInvalidArgument where the path has a
/// file of another kind.
void writeTrainedWeights(const TensorTable& tensors, const std::string& settings_json,
                         const std::string& path, const std::string& latents = {});
/// Writes trained weights with 16 bits for each number, each the nearest to what it was: half the
/// size, read by all that reads the others. In: from: a file of writeTrainedWeights(). Errors:
/// those of openWeightFile(); kInvalidArgument for weights that were not trained here, a number
/// that is too large for 16 bits, and where `to` has a file of another kind; kIo.
void writeHalfSizedWeights(const std::string& from, const std::string& to);
/// What weights learned with that were trained here: by the metadata of their file; those of others
/// have the published range. In: name, what messages call the file. Errors: kFormat for settings
/// that cannot be read, or are out of range.
LatentRange latentRangeOf(const std::map<std::string, std::string>& metadata,
                          const std::string& name);
/// Refuses a place where writeTrainedWeights() cannot write. Errors: as it.
void requireTrainedWeightsPlace(const std::string& path);

}  // namespace stipple
