#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace stipple::cli {

/// Seconds of wall time; the tool uses the library's header alone, and so has a clock of its own.
double secondsSince(std::chrono::steady_clock::time_point start);

/// Figures of a command, printed on stdout as lines or as one JSON object.
class Report {
 public:
  void add(const std::string& name, const std::string& value);
  void add(const std::string& name, const char* value) { add(name, std::string(value)); }
  void add(const std::string& name, double value);
  void add(const std::string& name, uint64_t value);
  void add(const std::string& name, const float (&values)[3]);
  void add(const std::string& name, const double (&values)[3]);
  void print(bool json) const;

 private:
  struct Entry {
    std::string name;
    std::string text;  ///< as shown to people
    std::string json;  ///< as a JSON value
  };
  std::vector<Entry> entries_;
};

}  // namespace stipple::cli
