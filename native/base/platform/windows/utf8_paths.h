#pragma once

// Every file is compiled with this header before all else (native/package/windows.cmake).
//
// Names of files are UTF-8 everywhere, and std::filesystem::path holds UTF-16 on Windows. libstdc++
// 12 makes UTF-8 of it in string(), but takes the bytes that it is given for single letters. Here
// it takes them for UTF-8, too, so that a name comes back as it went in. A libstdc++ that converts
// by another function does not compile this.
#include <filesystem>
#include <string>
#include <string_view>

template <>
inline auto std::filesystem::path::_S_convert<char>(const char* first, const char* last) {
  return std::filesystem::__detail::__wstr_from_utf8(std::string_view(first, last - first));
}
