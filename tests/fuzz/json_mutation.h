#pragma once

#include <cstdint>
#include <string>

namespace stipple::fuzz {

/// Where in a file its JSON stands.
enum class JsonPlace { kNowhere, kWholeFile, kGlbChunk, kSafetensorsHeader };

/// The file with one value of its JSON changed: another number, text or kind, left out, copied
/// elsewhere, or nested. The lengths around it are set right again, so that the change is found where
/// values are judged and not where bytes are counted. Empty where the file holds no JSON.
std::string withMutatedJson(const std::string& file, JsonPlace place, uint32_t seed);

}  // namespace stipple::fuzz
