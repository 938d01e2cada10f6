#pragma once

#include <string>

namespace stipple {

/// Opens a library of ours by its name, "stipple_media". It lies in the folder of the file that
/// holds this code, or for a program in ../lib or ../../lib of it. Out: path: where it was looked
/// for; why: the loader's reason where null is returned.
void* openOwnLibrary(const char* name, std::string& path, std::string& why);
/// The address of a function in it, or null.
void* findInLibrary(void* library, const char* function);
void closeOwnLibrary(void* library);

}  // namespace stipple
