#include "io/media/packing/packing_calls.h"

namespace stipple::media {

extern "C" const StipplePackingTable* stipple_packing_table(uint32_t version) {
  static const StipplePackingTable kTable = {
      kPackingTableVersion,        stipple_packing_gzip_unpack, stipple_packing_gzip_pack,
      stipple_packing_zstd_unpack, stipple_packing_zstd_pack,   stipple_packing_webp_size,
      stipple_packing_webp_decode, stipple_packing_webp_encode, stipple_packing_zip_inflate,
      stipple_packing_zip_checksum};
  return version == kPackingTableVersion ? &kTable : nullptr;
}

}  // namespace stipple::media
