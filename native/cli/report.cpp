#include "cli/report.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>

namespace stipple::cli {

namespace {

std::string number(double value) {
  char text[40];
  std::snprintf(text, sizeof(text), "%.9g", value);
  return text;
}

/// JSON has no infinity or NaN: null stands for them.
std::string jsonNumber(double value) {
  return std::isfinite(value) ? number(value) : "null";
}

std::string jsonString(const std::string& value) {
  std::string out = "\"";
  for (const char c : value) {
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      char escaped[8];
      std::snprintf(escaped, sizeof(escaped), "\\u%04x", static_cast<unsigned>(c));
      out += escaped;
    } else {
      out += c;
    }
  }
  return out + "\"";
}

template <typename T>
std::pair<std::string, std::string> triple(const T (&values)[3]) {
  std::string text, json = "[";
  for (int i = 0; i < 3; ++i) {
    const double value = static_cast<double>(values[i]);
    if (i > 0) {
      text += ' ';
      json += ", ";
    }
    text += number(value);
    json += jsonNumber(value);
  }
  return {text, json + "]"};
}

}  // namespace

double secondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void Report::add(const std::string& name, const std::string& value) {
  entries_.push_back({name, value, jsonString(value)});
}

void Report::add(const std::string& name, double value) {
  entries_.push_back({name, number(value), jsonNumber(value)});
}

void Report::add(const std::string& name, uint64_t value) {
  entries_.push_back({name, std::to_string(value), std::to_string(value)});
}

void Report::add(const std::string& name, const float (&values)[3]) {
  const auto [text, json] = triple(values);
  entries_.push_back({name, text, json});
}

void Report::add(const std::string& name, const double (&values)[3]) {
  const auto [text, json] = triple(values);
  entries_.push_back({name, text, json});
}

void Report::print(bool json) const {
  if (json) {
    std::printf("{");
    for (size_t i = 0; i < entries_.size(); ++i) {
      std::printf("%s%s: %s", i ? ", " : "", jsonString(entries_[i].name).c_str(),
                  entries_[i].json.c_str());
    }
    std::printf("}\n");
    return;
  }
  size_t width = 0;
  for (const Entry& entry : entries_) width = std::max(width, entry.name.size());
  for (const Entry& entry : entries_) {
    std::printf("%-*s  %s\n", static_cast<int>(width), entry.name.c_str(), entry.text.c_str());
  }
}

}  // namespace stipple::cli
