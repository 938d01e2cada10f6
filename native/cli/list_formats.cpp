#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "cli/commands.h"
#include "cli/formats.h"

namespace stipple::cli {

namespace {

/// Of the harmonics of trained files.
constexpr uint32_t kUsualDegree = 3;

const char* access(const StippleFormatInfo& format) {
  if (format.can_read == 0) return "written";
  return format.can_write != 0 ? "read and written" : "read";
}

/// What files of the format say of their splats beside the numbers.
std::vector<const char*> kept(const StippleFormatInfo& format) {
  std::vector<const char*> words;
  if (format.keeps_frame != 0) words.push_back("frame");
  if (format.keeps_colour_space != 0) words.push_back("colour space");
  if (format.keeps_antialias != 0) words.push_back("antialias");
  return words;
}

std::string joined(const std::vector<const char*>& words, const char* separator) {
  std::string text;
  for (const char* word : words) text += (text.empty() ? "" : separator) + std::string(word);
  return text;
}

/// Bytes of a splat of the usual degree in a file of a million; 0 where the format is not written.
double bytesOfSplat(size_t index) {
  constexpr uint64_t kSplats = 1000000;
  uint64_t bytes = 0;
  check(stipple_format_estimate(index, kSplats, kUsualDegree, nullptr, &bytes));
  return static_cast<double>(bytes) / static_cast<double>(kSplats);
}

void printAsJson() {
  std::printf("[");
  const char* separator = "";
  // The texts are names of the library's own, without anything that JSON would escape.
  // "endings" is what "extensions" was called before; programs that read it go on working.
  const std::vector<StippleFormatInfo> formats = splatFormats();
  for (size_t i = 0; i < formats.size(); ++i) {
    const StippleFormatInfo& format = formats[i];
    const std::string keeps = joined(kept(format), "\", \"");
    std::printf(
        "%s{\"name\": \"%s\", \"title\": \"%s\", \"extensions\": \"%s\", \"endings\": \"%s\", "
        "\"can_read\": %s, \"can_write\": %s, \"max_sh_degree\": %u, \"frame\": \"%s\", \"keeps\": "
        "[%s], \"holds_times\": %s, "
        "\"bytes_per_splat\": %.1f}",
        separator, format.name, format.title, format.extensions, format.extensions,
        format.can_read ? "true" : "false", format.can_write ? "true" : "false",
        static_cast<unsigned>(format.max_sh_degree), frameName(format.frame).c_str(),
        keeps.empty() ? "" : ('"' + keeps + '"').c_str(), format.holds_times ? "true" : "false",
        bytesOfSplat(i));
    separator = ", ";
  }
  std::printf("]\n");
}

}  // namespace

void addFormats(CLI::App& app) {
  auto json = std::make_shared<bool>(false);
  CLI::App* command = app.add_subcommand("formats", "The splat files that are read and written");
  command->add_flag("--json", *json, "Print one JSON array");
  command->callback([json] {
    if (*json) return printAsJson();
    const std::vector<StippleFormatInfo> formats = splatFormats();
    for (size_t i = 0; i < formats.size(); ++i) {
      const StippleFormatInfo& format = formats[i];
      std::printf("%-32s %-16s %-16s harmonics to degree %u, frame %s", format.title,
                  format.extensions, access(format), static_cast<unsigned>(format.max_sh_degree),
                  frameName(format.frame).c_str());
      const std::string keeps = joined(kept(format), ", ");
      if (!keeps.empty()) std::printf(", keeps %s", keeps.c_str());
      if (format.holds_times != 0) std::printf(", holds series");
      if (format.can_write != 0)
        std::printf(", about %.0f bytes a splat of degree %u", bytesOfSplat(i),
                    static_cast<unsigned>(std::min(kUsualDegree, format.max_sh_degree)));
      std::printf("\n");
    }
  });
}

}  // namespace stipple::cli
