#pragma once

#include <string>
#include <vector>

#include "data/training_history.h"
#include "plot/plot.h"

namespace stipple {

/// The history of a training of networks as JSON (docs/formats.md, "Training report"), and curves
/// beside it, with the extension .svg. In: settings_json: what it was started with. Errors: kIo;
/// kInvalidArgument where settings_json is no JSON, or a path has a file of another kind.
void writeTrainingReport(const std::string& settings_json, const TrainingHistory& history,
                         const std::string& path);
/// Refuses a place where the report or its curves cannot be written. Errors: kIo, kInvalidArgument.
void requireTrainingReportPlace(const std::string& path);

/// Losses, images, quality by step and by budget, learning rate.
std::vector<PlotPanel> trainingPlots(const TrainingHistory& history);

}  // namespace stipple
