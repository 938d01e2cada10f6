#pragma once

#include <cstdint>
#include <string>

namespace stipple {

/// A number for messages, names and files, as printf's %g writes it: at most `digits` significant
/// digits (1..17), no zeros behind them, an exponent where that is shorter. 17 digits give every
/// double back exactly. The program's locale changes nothing.
std::string numberText(double value, int digits = 6);

/// The sides of an image: "640 x 480".
std::string sizeText(uint64_t width, uint64_t height);

}  // namespace stipple
