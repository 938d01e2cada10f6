#pragma once

#include <string>

namespace stipple::platform {

/// A path of UTF-8 as Windows' own functions take it, of any length: names of more than 260 letters
/// need their whole path after the sign \\?\. Throws std::filesystem::filesystem_error for bytes
/// that are not UTF-8.
std::wstring systemName(const std::string& path);
/// The same of a path in UTF-16.
std::wstring systemName(const wchar_t* path);

/// A text of Windows as UTF-8.
std::string utf8Of(const wchar_t* text);

/// Leaves in errno what Windows' last error is called there.
void setErrnoFromSystem();

}  // namespace stipple::platform
