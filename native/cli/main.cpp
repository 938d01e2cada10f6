#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "cli/commands.h"
#include "cli/platform/system.h"

namespace {

using namespace stipple::cli;

/// As shells say it.
constexpr int kSignalExit = 128;

int run(int argc, char** argv) {
  if (stipple_abi_version() != STIPPLE_ABI_VERSION) {
    throw Failure("libstipple has ABI version " + std::to_string(stipple_abi_version()) +
                  "; this tool needs " + std::to_string(STIPPLE_ABI_VERSION));
  }
  CLI::App app("Stipple: density-controlled Gaussian splats", "stipple");
  app.require_subcommand(1);
  // Options begin with dashes on every system: on Windows CLI11 takes a word with a slash for one.
  app.allow_windows_style_options(false);
  app.set_version_flag("--version", stipple_version_string());
  Context context;
  uint32_t threads = 0;
  std::string weights;
  app.add_option("--threads", threads, "0: as many as the machine has")->capture_default_str();
  app.add_option(
      "--weights", weights,
      "Folder with files of networks' weights; default: the one that STIPPLE_WEIGHTS names");
  const auto create = [&] {
    StippleContextOptions options;
    stipple_context_options_init(&options);
    options.thread_count = threads;
    context =
        make<Context>(stipple_context_create, const_cast<const StippleContextOptions*>(&options));
    if (!weights.empty()) {
      check(stipple_context_set_weights_folder(context.get(), weights.c_str()));
    }
  };
  app.parse_complete_callback(create);
  addInfo(app, context);
  addConvert(app, context);
  addFormats(app);
  addDecode(app, context);
  addRender(app, context);
  addVoxelize(app, context);
  addMesh(app, context);
  addAdapt(app, context);
  addSeries(app, context);
  addCarry(app, context);
  addBind(app, context);
  addFit(app, context);
  addDensify(app, context);
  addDetail(app, context);
  addGenerate(app, context);
  addRandom(app, context);
  addTrain(app, context);
  addEncode(app, context);
  addShrink(app);
  addCompare(app, context);
  addAccuracy(app, context);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& answer) {
    return app.exit(answer);
  } catch (const CLI::ParseError& error) {
    std::fprintf(stderr, "stipple: %s\n", error.what());
    return 2;
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  listenForSignals();
  try {
    std::vector<std::string> words = wordsOf(argc, argv);
    std::vector<char*> pointers;
    for (std::string& word : words) pointers.push_back(word.data());
    return run(static_cast<int>(pointers.size()), pointers.data());
  } catch (const Interrupted& interrupted) {
    std::fprintf(stderr, "stipple: %s\n", interrupted.what());
    return kSignalExit + interrupted.signal;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "stipple: %s\n", error.what());
    return 1;
  }
}
