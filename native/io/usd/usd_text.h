#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace stipple {

/// A value of a layer. Of which kind it is says its type: one of the three holds something.
struct UsdValue {
  std::vector<double> numbers;     ///< a number, tuple or matrix, row by row
  std::vector<float> floats;       ///< an array of numbers or tuples, one behind the other
  std::vector<std::string> words;  ///< tokens, strings, truth values: one, or an array of them
};

/// An attribute of a prim: its value, and values at times (time codes), where it has those.
struct UsdAttribute {
  std::string type;  ///< as the layer has it: "point3f[]"
  std::optional<UsdValue> value;
  std::map<double, UsdValue> samples;

  /// The value, or that of the first time; null where there is neither. In: time, if one is asked
  /// for: then the value of the last time up to it, or of the first, or the one without times.
  const UsdValue* at(std::optional<double> time) const;
};

/// Where else a prim's content comes from: references, payloads and classes that it inherits.
struct UsdArc {
  std::string layer;  ///< relative path; empty: the same layer
  std::string prim;   ///< absolute path in it; empty: the layer's default prim
};

struct UsdPrim {
  bool is_defined = false;  ///< by "def", not by "over"
  bool is_class = false;
  std::optional<bool> is_active;
  std::string type, name;
  std::map<std::string, std::string> custom;  ///< strings of customData, keys joined by ':'
  std::vector<UsdArc> arcs;                   ///< the strongest first
  std::map<std::string, UsdAttribute> attributes;
  std::vector<std::unique_ptr<UsdPrim>> children;

  const UsdPrim* child(std::string_view of_name) const;
};

/// One layer, as it stands in its file: nothing is composed yet.
struct UsdLayer {
  std::string up_axis;  ///< "Y", "Z"; empty where it is not said
  std::string default_prim;
  std::optional<double> metres_per_unit;
  std::optional<double> time_codes_per_second, frames_per_second;
  std::vector<std::string> sublayers;  ///< relative paths, the strongest first
  UsdPrim root;                        ///< without a name; its children are the layer's prims
};

/// Reads a layer of text (USDA 1.0). Variants, relationships, connections and values of types that
/// no splats have are passed over. In: name, of the file in messages.
/// Errors: kFormat with the line and what was expected there.
UsdLayer parseUsdText(std::string_view text, const std::string& name);

}  // namespace stipple
