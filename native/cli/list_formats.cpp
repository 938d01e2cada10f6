#include <cstdio>
#include <memory>
#include <string>

#include "cli/commands.h"
#include "cli/formats.h"

namespace stipple::cli {

namespace {

const char* access(const StippleFormatInfo& format) {
  if (format.can_read == 0) return "written";
  return format.can_write != 0 ? "read and written" : "read";
}

void printAsJson() {
  std::printf("[");
  const char* separator = "";
  // The texts are names of the library's own, without anything that JSON would escape.
  for (const StippleFormatInfo& format : splatFormats()) {
    std::printf(
        "%s{\"name\": \"%s\", \"title\": \"%s\", \"endings\": \"%s\", \"can_read\": %s, "
        "\"can_write\": %s, \"max_sh_degree\": %u, \"frame\": \"%s\"}",
        separator, format.name, format.title, format.endings, format.can_read ? "true" : "false",
        format.can_write ? "true" : "false", static_cast<unsigned>(format.max_sh_degree),
        frameName(format.frame).c_str());
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
    for (const StippleFormatInfo& format : splatFormats()) {
      std::printf("%-16s %-16s %-16s harmonics to degree %u, frame %s\n", format.title,
                  format.endings, access(format), static_cast<unsigned>(format.max_sh_degree),
                  frameName(format.frame).c_str());
    }
  });
}

}  // namespace stipple::cli
