#include <mpi.h>
#include <signal.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>

#include "base/error.h"
#include "base/parallel.h"
#include "cli/jobs/signals.h"
#include "cli/jobs/status_line.h"
#include "cli/report.h"
#include "fit/training/training_session.h"
#include "mpi/mpi_exchange.h"
#include "train/backend/backend_table.h"

namespace {

using namespace stipple;

constexpr char kProgram[] = "stipple-train-mpi";
constexpr auto kPollInterval = std::chrono::milliseconds(50);
constexpr int kUsageExit = 2;
constexpr int kSignalExit = 128;  // as shells say it
/// In which the leader writes its checkpoint and ends all processes.
constexpr double kLeaderSeconds = 600;

struct Arguments {
  std::string config;
  unsigned threads = 0;
  bool resume = false, json = false;
};

/// "Joint  1200 / 2000  loss 0.0312  PSNR 23.41 dB  1:23 left"
std::string lineOf(const TrainingStatus& status) {
  std::string line = status.stage;
  if (status.step == 0) return line;
  char text[96];
  std::snprintf(text, sizeof(text), "  %llu / %llu  loss %.4f",
                static_cast<unsigned long long>(status.step),
                static_cast<unsigned long long>(status.steps), status.loss);
  line += text;
  if (std::isfinite(status.psnr)) {
    std::snprintf(text, sizeof(text), "  PSNR %.2f dB", status.psnr);
    line += text;
  }
  return line + "  " + cli::timeText(status.seconds_left) + " left";
}

/// While a training runs: cancels it when a signal comes, and shows how it is doing.
class Watch {
 public:
  /// In: both must outlive this; whether anything is shown.
  Watch(const TrainingSession& session, Progress& progress, bool shows)
      : session_(session), progress_(progress), shows_(shows), thread_([this] { run(); }) {}
  ~Watch() {
    has_ended_ = true;
    thread_.join();
  }
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

 private:
  void run() {
    while (!has_ended_) {
      if (cli::notedSignal() != 0) progress_.cancel();
      if (shows_) show();
      std::this_thread::sleep_for(kPollInterval);
    }
    if (shows_) show();
    line_.clear();
  }

  void show() {
    const TrainingStatus status = session_.status();
    if (status.note_count > printed_) line_.clear();
    for (; printed_ < status.note_count; ++printed_) {
      std::fprintf(stderr, "%s: note: %s\n", kProgram, session_.noteAt(printed_));
    }
    line_.show(progress_.fraction(), status.stage, lineOf(status));
  }

  const TrainingSession& session_;
  Progress& progress_;
  bool shows_;
  size_t printed_ = 0;
  cli::StatusLine line_;
  std::atomic<bool> has_ended_{false};
  std::thread thread_;  ///< last: it reads the rest
};

void print(const TrainingSession& session, size_t processes, bool json) {
  const TrainingStatus status = session.status();
  cli::Report report;
  report.add("processes", uint64_t{processes});
  report.add("steps", status.step);
  report.add("skipped_steps", status.skipped);
  report.add("objects", status.objects);
  report.add("held_out_objects", status.held_out);
  report.add("best_step", status.best_step);
  const std::string of = status.held_out == 0 ? "training_" : "held_out_";
  for (size_t i = 0; i < status.budget_count; ++i) {
    const TrainingMeasure at = session.budgetAt(i);
    const std::string budget = std::to_string(at.anchors) + "_anchors";
    report.add(of + "psnr_" + budget, at.psnr);
    report.add(of + "ssim_" + budget, at.ssim);
  }
  report.add("seconds", status.seconds);
  report.print(json);
}

/// Ends all processes. The exchange lives on: MPI may still write to its memory.
[[noreturn]] void giveUp(MpiExchange& exchange, const std::string& why, int status) {
  if (exchange.rank() == 0) {
    std::fprintf(stderr, "%s: %s\n", kProgram, why.c_str());
  } else {
    // The leader has a checkpoint to write, and then ends this process by a signal.
    for (const int number : {SIGINT, SIGTERM, SIGHUP}) ::signal(number, SIG_DFL);
    exchange.tellLeader(why);
    exchange.linger(kLeaderSeconds);
  }
  if (exchange.size() > 1) MPI_Abort(MPI_COMM_WORLD, status);
  MPI_Finalize();
  std::exit(status);
}

void sayWhereItGoesOn(const TrainingSession& session, const std::string& config) {
  const uint64_t step = session.status().step;
  if (step == 0 || !std::filesystem::exists(trainingCheckpointPath(session.config().out))) return;
  std::fprintf(stderr,
               "%s: stopped after step %llu; the same command with --resume goes on, and so does "
               "'stipple train %s --resume'\n",
               kProgram, static_cast<unsigned long long>(step), config.c_str());
}

void train(const Arguments& arguments) {
  Progress progress;
  const auto exchange = std::make_shared<MpiExchange>(progress);
  const bool leads = exchange->rank() == 0;
  std::unique_ptr<TrainingSession> session;
  try {
    session = std::make_unique<TrainingSession>(chosenBackends(), arguments.config,
                                                arguments.resume, exchange);
    const Watch watch(*session, progress, leads);
    withThreads(arguments.threads, [&] { session->run(progress); });
    exchange->meet();
  } catch (const std::exception& error) {
    if (leads && session) sayWhereItGoesOn(*session, arguments.config);
    // The others are stopped by the same signal, and may have said so before it was noticed here.
    const int number = cli::notedSignal();
    if (number == 0) giveUp(*exchange, error.what(), 1);
    giveUp(*exchange, cli::Interrupted(number).what(), kSignalExit + number);
  }
  if (leads) print(*session, exchange->size(), arguments.json);
}

/// All processes get the same arguments: only the first speaks of them.
int parse(int argc, char** argv, Arguments& to) {
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  CLI::App app(
      "Learns networks from a collection of objects in several processes, started by "
      "mpirun or srun (docs/training.md)",
      kProgram);
  app.add_option("config", to.config, "JSON file with the settings of the training")->required();
  app.add_flag("--resume", to.resume, "Go on from the checkpoint in the folder of results");
  app.add_option("--threads", to.threads, "Of each process; 0: as many as it may have")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  app.add_flag("--json", to.json, "Figures as JSON");
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& answer) {
    if (rank == 0) app.exit(answer);
    return 0;
  } catch (const CLI::ParseError& error) {
    if (rank == 0) std::fprintf(stderr, "%s: %s\n", kProgram, error.what());
    return kUsageExit;
  }
  return -1;
}

}  // namespace

int main(int argc, char** argv) {
  int level = 0;
  if (MPI_Init_thread(&argc, &argv, MPI_THREAD_SERIALIZED, &level) != MPI_SUCCESS) return 1;
  cli::listenForSignals();
  Arguments arguments;
  int status = parse(argc, argv, arguments);
  if (status < 0) {
    train(arguments);
    status = 0;
  }
  MPI_Finalize();
  return status;
}
