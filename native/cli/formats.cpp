#include "cli/formats.h"

#include <algorithm>
#include <cctype>
#include <sstream>

namespace stipple::cli {

namespace {

constexpr const char* kFrames[] = {"unknown", "LDB", "RDB", "LUB", "RUB", "LDF",
                                   "RDF",     "LUF", "RUF", "LFD", "RFD", "LFU",
                                   "RFU",     "LBD", "RBD", "LBU", "RBU"};

std::vector<std::string> words(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> found;
  for (std::string word; stream >> word;) found.push_back(word);
  return found;
}

}  // namespace

std::vector<StippleFormatInfo> splatFormats() {
  uint64_t count = 0;
  check(stipple_format_count(&count));
  std::vector<StippleFormatInfo> formats;
  for (uint64_t i = 0; i < count; ++i) {
    auto info = sized<StippleFormatInfo>();
    check(stipple_format_info(i, &info));
    formats.push_back(info);
  }
  return formats;
}

std::string formatOfExtension(const std::string& path) {
  std::string name = path.substr(path.find_last_of('/') + 1);
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  std::string found;
  size_t longest = 0;
  for (const StippleFormatInfo& format : splatFormats()) {
    for (const std::string& extension : words(format.extensions)) {
      if (extension.size() > longest && name.ends_with(extension)) {
        found = format.name;
        longest = extension.size();
      }
    }
  }
  return found;
}

bool hasSplatExtension(const std::string& path) {
  return !formatOfExtension(path).empty();
}

std::string splatExtensions(bool written) {
  std::vector<std::string> extensions;
  for (const StippleFormatInfo& format : splatFormats()) {
    if (written && format.can_write == 0) continue;
    for (const std::string& extension : words(format.extensions)) extensions.push_back(extension);
  }
  std::string text;
  for (size_t i = 0; i < extensions.size(); ++i) {
    if (i > 0) text += i + 1 == extensions.size() ? " or " : ", ";
    text += extensions[i];
  }
  return text;
}

std::string frameName(uint32_t frame) {
  return frame <= STIPPLE_FRAME_RBU ? kFrames[frame] : "unknown";
}

uint32_t frameOfName(const std::string& name) {
  for (uint32_t i = STIPPLE_FRAME_LDB; i <= STIPPLE_FRAME_RBU; ++i) {
    if (name == kFrames[i]) return i;
  }
  throw Failure("'" + name +
                "' is not a frame; three letters such as RDF, RUB or RFU are expected");
}

}  // namespace stipple::cli
