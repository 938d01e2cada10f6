#pragma once

#include <string>
#include <vector>

/// What the tool asks of the system itself, which each system has in its own way: platform/posix
/// and platform/windows implement it, and one of the folders is built.
namespace stipple::cli {

/// The words of the command line, the tool's name first, in UTF-8. What is printed is shown as
/// UTF-8 from then on.
std::vector<std::string> wordsOf(int argc, char** argv);

/// Whether somebody watches what is written to the error stream.
bool isTerminal();

/// Whether files can be made in a folder.
bool isWritable(const std::string& folder);

/// A new folder among temporary files that nobody else can write to, since others may guess a name.
/// Errors: Failure.
std::string newTemporaryFolder();

/// From here on Ctrl-C, and what asks a program to end (SIGTERM, SIGHUP unless nohup has it
/// ignored; a console that is closed), calls `note` with the signal's number. It may come on
/// another thread, and while this one does anything.
void onSignals(void (*note)(int number));
/// Of these signals.
const char* signalName(int number);
/// Ends the process as the signal would have. For the function that onSignals() calls.
void endBy(int number);
/// Whole seconds of a clock that is never set. For the function that onSignals() calls.
long secondsNow();

/// Writing to a pipe that nobody reads is an error from here on, not an end.
void ignoreClosedPipes();

}  // namespace stipple::cli
