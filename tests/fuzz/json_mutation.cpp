#include "json_mutation.h"

#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <vector>

namespace stipple::fuzz {

namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kGlbHead = 20;
// Deeper or longer inputs are left to the mutation of bytes.
constexpr size_t kMaxText = 1 << 16;
constexpr size_t kMaxNesting = 400;

struct Parts {
  std::string before, text, after;
};

template <typename T>
T numberAt(const std::string& bytes, size_t at) {
  T value = 0;
  std::memcpy(&value, &bytes[at], sizeof(T));
  return value;
}

template <typename T>
void setNumber(std::string& bytes, size_t at, T value) {
  std::memcpy(&bytes[at], &value, sizeof(T));
}

std::optional<Parts> split(const std::string& file, JsonPlace place) {
  if (place == JsonPlace::kWholeFile) return Parts{"", file, ""};
  size_t begin = 8;
  uint64_t length = 0;
  if (place == JsonPlace::kGlbChunk) {
    begin = kGlbHead;
    if (file.size() < begin || file.compare(0, 4, "glTF") != 0) return std::nullopt;
    length = numberAt<uint32_t>(file, 12);
  } else if (file.size() >= begin) {
    length = numberAt<uint64_t>(file, 0);
  }
  if (file.size() < begin || length > file.size() - begin) return std::nullopt;
  const auto end = begin + static_cast<size_t>(length);
  return Parts{file.substr(0, begin), file.substr(begin, end - begin), file.substr(end)};
}

std::string join(Parts parts, JsonPlace place) {
  if (place != JsonPlace::kWholeFile) parts.text.resize((parts.text.size() + 7) / 8 * 8, ' ');
  if (place == JsonPlace::kSafetensorsHeader) setNumber<uint64_t>(parts.before, 0, parts.text.size());
  if (place == JsonPlace::kGlbChunk) {
    setNumber(parts.before, 12, static_cast<uint32_t>(parts.text.size()));
    setNumber(parts.before, 8,
              static_cast<uint32_t>(parts.before.size() + parts.text.size() + parts.after.size()));
  }
  return parts.before + parts.text + parts.after;
}

void collect(Json& value, std::vector<Json*>& all) {
  all.push_back(&value);
  if (!value.is_structured()) return;
  for (auto& child : value) collect(child, all);
}

class Mutation {
 public:
  Mutation(Json& root, uint32_t seed) : random_(seed) { collect(root, all_); }

  void apply() {
    Json& value = any();
    switch (below(8)) {
      case 0:
        value = number();
        break;
      case 1:
        value = text();
        break;
      case 2:
        value = any().is_structured() ? Json::array() : Json(nullptr);
        break;
      case 3: {
        const Json copy = any();
        value = copy;
        break;
      }
      case 4:
        if (value.is_structured() && !value.empty()) {
          value.erase(std::next(value.begin(), static_cast<std::ptrdiff_t>(below(value.size()))));
        }
        break;
      case 5:
        if (value.is_array() && !value.empty()) {
          const Json copy = value[below(value.size())];
          for (size_t i = below(64); i-- > 0;) value.push_back(copy);
        }
        break;
      case 6: {
        Json inner = value;
        for (size_t i = below(3) == 0 ? below(kMaxNesting) : 1; i-- > 0;) {
          Json outer = Json::array();
          outer.push_back(std::move(inner));
          inner = std::move(outer);
        }
        value = std::move(inner);
        break;
      }
      default:
        if (value.is_number()) {
          value = value.get<double>() * (below(2) == 0 ? -1.0 : 2.0) + static_cast<double>(below(3));
        } else {
          value = number();
        }
    }
  }

 private:
  size_t below(size_t count) { return std::uniform_int_distribution<size_t>(0, count - 1)(random_); }
  Json& any() { return *all_[below(all_.size())]; }

  Json number() {
    const Json kNumbers[] = {0,          1,       -1,          2,       255,
                             65536,      1 << 26, 2147483647u, -5,      4294967295u,
                             1ull << 40, 1ull << 63, ~0ull,    0.5,     -0.0,
                             1e-300,     1e300,   3.5e38,      16777217, 5126};
    return kNumbers[below(std::size(kNumbers))];
  }

  Json text() {
    const char* kTexts[] = {"", ".", "..", "../a", "/", "means_l.webp", "0_0/meta.json", "VEC3", "F32", "nan"};
    return kTexts[below(std::size(kTexts))];
  }

  std::mt19937 random_;
  std::vector<Json*> all_;
};

}  // namespace

std::string withMutatedJson(const std::string& file, JsonPlace place, uint32_t seed) {
  std::optional<Parts> parts = split(file, place);
  if (!parts || parts->text.size() > kMaxText) return "";
  Json root = Json::parse(parts->text, nullptr, false);
  if (root.is_discarded()) return "";
  Mutation(root, seed).apply();
  parts->text = root.dump(-1, ' ', false, Json::error_handler_t::replace);
  return join(std::move(*parts), place);
}

}  // namespace stipple::fuzz
