#include "cli/dataset.h"

#include "cli/numbers.h"

namespace stipple::cli {

Views openViews(const Context& context, const std::string& dataset, int64_t downscale) {
  StippleViewsOpenOptions options;
  stipple_views_open_options_init(&options);
  options.downscale = counted32(downscale, "--downscale");
  options.cache_bytes = 0;  // who works with them keeps them
  return make<Views>(stipple_views_open, context.get(), dataset.c_str(),
                     const_cast<const StippleViewsOpenOptions*>(&options));
}

}  // namespace stipple::cli
