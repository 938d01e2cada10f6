#include "cli/platform/system.h"

#include <io.h>
#include <signal.h>
#include <windows.h>
// Uses what the one before declares.
#include <shellapi.h>

#include <filesystem>

#include "cli/library.h"

namespace stipple::cli {

namespace {

// As shells say it.
constexpr UINT kSignalExit = 128;
constexpr int kFolderTries = 100;

void (*g_note)(int number) = nullptr;

/// Called on a thread that Windows starts for it.
BOOL WINAPI noteEvent(DWORD event) {
  g_note(event == CTRL_C_EVENT || event == CTRL_BREAK_EVENT ? SIGINT : SIGTERM);
  // A console that is closed ends its programs when this returns, at the latest after seconds that
  // Windows chooses: time for what is being written.
  if (event != CTRL_C_EVENT && event != CTRL_BREAK_EVENT) ::Sleep(INFINITE);
  return TRUE;
}

std::string utf8Of(const wchar_t* text) {
  return std::filesystem::path(text).string();
}

}  // namespace

std::vector<std::string> wordsOf(int argc, char** argv) {
  ::SetConsoleOutputCP(CP_UTF8);
  // main() gets the words in the machine's own code page, which lacks most letters.
  int count = 0;
  wchar_t** wide = ::CommandLineToArgvW(::GetCommandLineW(), &count);
  if (wide == nullptr) return {argv, argv + argc};
  std::vector<std::string> words;
  for (int i = 0; i < count; ++i) words.push_back(utf8Of(wide[i]));
  ::LocalFree(wide);
  return words;
}

bool isTerminal() {
  return ::_isatty(::_fileno(stderr)) != 0;
}

bool isWritable(const std::string&) {
  // Windows has no such sign of folders; who may write there is found out by writing.
  return true;
}

std::string newTemporaryFolder() {
  const std::filesystem::path around = std::filesystem::temp_directory_path();
  // The folder of temporary files is the user's own.
  for (int i = 0; i < kFolderTries; ++i) {
    const std::string name = "stipple-" + std::to_string(::GetCurrentProcessId()) + "-" +
                             std::to_string(::GetTickCount64() + static_cast<unsigned>(i));
    std::error_code error;
    if (std::filesystem::create_directory(around / name, error)) return (around / name).string();
  }
  throw Failure("no folder can be made in '" + around.string() + "'");
}

void onSignals(void (*note)(int number)) {
  g_note = note;
  ::SetConsoleCtrlHandler(noteEvent, TRUE);
}

const char* signalName(int number) {
  return number == SIGINT ? "Ctrl-C" : "the end of its console";
}

void endBy(int number) {
  ::TerminateProcess(::GetCurrentProcess(), kSignalExit + static_cast<UINT>(number));
}

long secondsNow() {
  return static_cast<long>(::GetTickCount64() / 1000);
}

// Windows says it by an error in any case.
void ignoreClosedPipes() {}

}  // namespace stipple::cli
