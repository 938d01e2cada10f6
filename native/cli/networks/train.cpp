#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <thread>

#include "cli/commands.h"
#include "cli/jobs/signals.h"
#include "cli/jobs/status_line.h"
#include "cli/report.h"

namespace stipple::cli {

namespace {

constexpr auto kPollInterval = std::chrono::milliseconds(50);

struct Arguments {
  std::string config;
  bool resume = false, json = false;
};

/// "Joint  1200 / 2000  loss 0.0312  density 0.21 nats  PSNR 23.41 dB  1:23 left"
std::string lineOf(const StippleTrainFigures& figures) {
  char text[160];
  std::string line = figures.stage;
  if (figures.step == 0) return line;
  std::snprintf(text, sizeof(text), "  %llu / %llu  loss %.4f",
                static_cast<unsigned long long>(figures.step),
                static_cast<unsigned long long>(figures.steps), figures.loss);
  line += text;
  if (figures.structure > 0) {  // The flow has none.
    std::snprintf(text, sizeof(text), "  density %.3f nats", figures.structure);
    line += text;
  }
  if (std::isfinite(figures.psnr)) {
    std::snprintf(text, sizeof(text), "  PSNR %.2f dB", figures.psnr);
    line += text;
  }
  return line + "  " + timeText(figures.seconds_left) + " left";
}

void printNotes(const Job& job, uint64_t& printed, uint64_t count) {
  for (; printed < count; ++printed) {
    const char* text = nullptr;
    check(stipple_train_note(job.get(), printed, &text));
    std::fprintf(stderr, "stipple: note: %s\n", text);
  }
}

/// Waits for the end. Ctrl-C, SIGTERM and SIGHUP end the training with a checkpoint.
StippleTrainFigures watch(const Job& job, const std::string& config) {
  StatusLine line;
  auto progress = sized<StippleJobProgress>();
  auto figures = sized<StippleTrainFigures>();
  uint64_t printed = 0;
  for (;;) {
    check(stipple_job_poll(job.get(), &progress));
    check(stipple_train_figures(job.get(), &figures));
    if (figures.note_count > printed) line.clear();
    printNotes(job, printed, figures.note_count);
    if (progress.state != STIPPLE_JOB_RUNNING) break;
    if (notedSignal() != 0) check(stipple_job_cancel(job.get()));
    line.show(progress.fraction, figures.stage, lineOf(figures));
    std::this_thread::sleep_for(kPollInterval);
  }
  line.clear();
  const StippleStatus status = stipple_job_wait(job.get());
  if (status == STIPPLE_ERROR_CANCELLED && figures.step > 0) {
    std::fprintf(stderr, "stipple: stopped after step %llu; 'stipple train %s --resume' goes on\n",
                 static_cast<unsigned long long>(figures.step), config.c_str());
  }
  if (status == STIPPLE_ERROR_CANCELLED) throw Interrupted(notedSignal());
  check(status);
  return figures;
}

void train(const Context& context, const Arguments& arguments) {
  const SignalHold hold;
  const auto job = make<Job>(stipple_train_start, context.get(), arguments.config.c_str(),
                             arguments.resume ? 1u : 0u);
  const StippleTrainFigures figures = watch(job, arguments.config);
  Report report;
  report.add("steps", figures.step);
  report.add("skipped_steps", figures.skipped_steps);
  report.add("objects", figures.object_count);
  report.add("held_out_objects", figures.held_out_count);
  report.add("best_step", figures.best_step);
  for (uint64_t i = 0; i < figures.budget_count; ++i) {
    auto budget = sized<StippleTrainBudget>();
    check(stipple_train_budget(job.get(), i, &budget));
    const bool is_detail = budget.coarse_splats > 0;
    const std::string at = std::to_string(budget.anchors) + (is_detail ? "_splats" : "_anchors");
    const std::string of = figures.measured_on_training ? "training_" : "held_out_";
    report.add(of + "psnr_" + at, budget.psnr);
    report.add(of + "ssim_" + at, budget.ssim);
    if (!is_detail) continue;
    report.add(of + "coarse_psnr_" + std::to_string(budget.coarse_splats) + "_splats",
               budget.coarse_psnr);
    report.add(of + "cut_psnr_" + at, budget.cut_psnr);
  }
  report.add("seconds", figures.seconds);
  report.print(arguments.json);
}

}  // namespace

void addTrain(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  Arguments& to = *arguments;
  CLI::App* command = app.add_subcommand(
      "train",
      "Learns a density autoencoder, or detail, from a collection of objects (docs/training.md)");
  command->add_option("config", to.config, "JSON file with the settings of the training")
      ->required();
  command->add_flag("--resume", to.resume, "Go on from the checkpoint in the folder of results");
  command->add_flag("--json", to.json, "Figures as JSON");
  command->callback([arguments, &context] { train(context, *arguments); });
}

}  // namespace stipple::cli
