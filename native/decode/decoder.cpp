#include "decode/decoder.h"

#include "base/error.h"

namespace stipple {

SplatCloud Decoder::decodeSmooth(const DecodeRequest&) const {
  fail(ErrorCode::kUnsupported, "budgets: these splats do not say which of them they grow from");
}

}  // namespace stipple
