#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "base/error.h"
#include "base/progress.h"

namespace stipple {

/// Which file of weights something was made with. Assets name it and do not hold it, since it is a
/// thousand times their size and the same for all of them.
struct WeightsReference {
  std::string name;    ///< of the file, without folders
  uint64_t bytes = 0;  ///< its size
  std::string sha256;  ///< of its content, 64 hexadecimal digits in lower case
};

/// Refuses a reference that cannot be one. In: what: names it in the message; code: of the error.
void validate(const WeightsReference& weights, const std::string& what, ErrorCode code);

/// The reference of a file that is there. Errors: kIo; kCancelled. Cost: reads the file once in the
/// life of this process (sha256OfFile).
WeightsReference referenceOf(const std::string& path, Progress* progress = nullptr);

/// The path of the file that is meant, which may have another name and lie in a subfolder.
/// In: folders: of files of weights, looked through one after the other; what: names what needs it
/// in the message. Errors: kUnavailable, with one sentence that names file and folders, where it is
/// in none of them; those of weightFilesBelow() and referenceOf().
std::string findReferenced(const WeightsReference& weights, std::span<const std::string> folders,
                           const std::string& what, Progress* progress = nullptr);

}  // namespace stipple
