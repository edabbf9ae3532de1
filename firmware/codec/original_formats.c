/* The variants of the original hub's messages, with the boards of their tables. */
#include "codec/original.h"

#define TAXELS(address, taxels, accelerations) [address] = (taxels),
#define EXTRA(address, taxels, accelerations) [address] = (accelerations),
#define DEFINE(name, boards, timestamp, big_endian, record) \
    const struct taxel_original_format taxel_format_##name = { \
        .taxels = {boards(TAXELS)}, \
        .accelerations = {boards(EXTRA)}, \
        .has_timestamp = (timestamp), \
        .is_big_endian = (big_endian), \
        .record_size = (record), \
    };
TAXEL_ORIGINAL_FORMATS(DEFINE)
