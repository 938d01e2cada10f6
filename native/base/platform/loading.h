#pragma once

#include <filesystem>
#include <string>

namespace stipple::platform {

/// The file that holds this code: the shared library, or a program that it is linked into. Empty
/// where the system does not tell.
std::filesystem::path ownFile();

/// What the file of a shared library is called: "libstipple_media.so", "stipple_media.dll".
std::string libraryFile(const std::string& name);

/// Opens a shared library. Returns: null, with the loader's reason in `why`, where it cannot be.
void* openLibrary(const std::string& path, std::string& why);
/// The address of a function, or null.
void* functionOf(void* library, const char* function);
void closeLibrary(void* library);

}  // namespace stipple::platform
