#pragma once

#include <CLI/CLI.hpp>

#include <string>

#include "cli/library.h"

namespace stipple::cli {

/// Which camera a command draws from, and at which size.
struct CameraArguments {
  std::string path;
  uint64_t view = 0;
  uint32_t width = 0, height = 0;
};

void addCameraOptions(CLI::App& command, CameraArguments& arguments);

/// The view at the asked size; one missing side follows from the other.
StippleCamera cameraOf(const Context& context, const CameraArguments& arguments);

}  // namespace stipple::cli
