#pragma once

#include <CLI/CLI.hpp>

#include "cli/library.h"

namespace stipple::cli {

/// Each adds one subcommand to the tool; its callback does the work and throws Failure.
void addInfo(CLI::App& app, const Context& context);
void addConvert(CLI::App& app, const Context& context);
void addFormats(CLI::App& app);
void addDecode(CLI::App& app, const Context& context);
void addRender(CLI::App& app, const Context& context);
void addVoxelize(CLI::App& app, const Context& context);
void addSeries(CLI::App& app, const Context& context);
void addCarry(CLI::App& app, const Context& context);
void addBind(CLI::App& app, const Context& context);
void addMesh(CLI::App& app, const Context& context);
void addAdapt(CLI::App& app, const Context& context);
void addFit(CLI::App& app, const Context& context);
void addDensify(CLI::App& app, const Context& context);
void addDetail(CLI::App& app, const Context& context);
void addGenerate(CLI::App& app, const Context& context);
void addRandom(CLI::App& app, const Context& context);
void addEncode(CLI::App& app, const Context& context);
void addShrink(CLI::App& app);
void addTrain(CLI::App& app, const Context& context);
void addCompare(CLI::App& app, const Context& context);
void addAccuracy(CLI::App& app, const Context& context);

/// What a file holds, told by its extension.
enum class FileKind { kSplats, kMesh, kModel, kViews, kVolume, kImage };
FileKind fileKind(const std::string& path);
/// True for .safetensors.
bool hasModelExtension(const std::string& path);

}  // namespace stipple::cli
