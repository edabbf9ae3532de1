-- Generated from protocol/taxel_protocol by tools/codegen/clients.py (make generate). Do not edit.
-- Constants and message formats of the original hub.
local original = {}

original.START = 1
original.END = 10
original.HEADER_SIZE = 3
original.TIMESTAMP_SIZE = 4
original.ACCELERATIONS = 3
original.RECORD_ADDRESS = 8
original.REFERENCE_TIMES = 4
original.TIME_STEP_MAX_MS = 60000

-- Variants of the message by name: taxels and accelerations by address. record_size: bytes of a record
-- without a frame, 0 for framed messages.
original.formats = {
    original = { name = "original", has_timestamp = true, is_big_endian = false, record_size = 0,
        taxels = { [8] = 65, [9] = 30, [10] = 78, [11] = 66, [12] = 27, [13] = 65, [14] = 30, [15] = 78, [16] = 66, [17] = 31, [18] = 65, [19] = 47, [20] = 78, [21] = 121, [22] = 118, [23] = 66, [24] = 27, [25] = 65, [26] = 30, [27] = 78, [28] = 66, [29] = 27 },
        accelerations = {},
    },
    original_accelerations = { name = "original_accelerations", has_timestamp = true, is_big_endian = false, record_size = 0,
        taxels = { [8] = 65, [9] = 30, [10] = 78, [11] = 66, [12] = 27, [13] = 65, [14] = 30, [15] = 78, [16] = 66, [17] = 31, [18] = 65, [19] = 47, [20] = 78, [21] = 121, [22] = 118, [23] = 66, [24] = 27, [25] = 65, [26] = 30, [27] = 78, [28] = 66, [29] = 27 },
        accelerations = { [11] = 3, [16] = 3, [23] = 3, [28] = 3 },
    },
    first_generation = { name = "first_generation", has_timestamp = true, is_big_endian = false, record_size = 0,
        taxels = { [8] = 6, [9] = 6, [10] = 15, [11] = 14, [12] = 6, [13] = 6, [14] = 6, [15] = 15, [16] = 14, [17] = 6, [18] = 6, [19] = 6, [20] = 6, [21] = 20, [22] = 25, [23] = 14, [24] = 6, [25] = 6, [26] = 6, [27] = 15, [28] = 14, [29] = 6 },
        accelerations = {},
    },
    first_generation_test = { name = "first_generation_test", has_timestamp = true, is_big_endian = true, record_size = 0,
        taxels = { [8] = 6, [9] = 6, [10] = 15, [11] = 14, [12] = 6, [13] = 6, [14] = 6, [15] = 15, [16] = 14, [17] = 6, [18] = 6, [19] = 6, [20] = 6, [21] = 20, [22] = 25, [23] = 14, [24] = 6, [25] = 6, [26] = 6, [27] = 15, [28] = 14, [29] = 6 },
        accelerations = {},
    },
    first_generation_untimed = { name = "first_generation_untimed", has_timestamp = false, is_big_endian = false, record_size = 0,
        taxels = { [1] = 14, [2] = 6, [3] = 6, [4] = 6, [5] = 15, [6] = 14, [7] = 6, [8] = 6, [9] = 6, [10] = 15, [11] = 14, [12] = 6, [13] = 6, [14] = 6, [15] = 15, [16] = 14, [17] = 6, [18] = 6, [19] = 6, [20] = 6, [21] = 20, [22] = 25, [23] = 14, [24] = 6, [25] = 6, [26] = 6, [27] = 15, [28] = 14, [29] = 6 },
        accelerations = {},
    },
    fingertip_records = { name = "fingertip_records", has_timestamp = false, is_big_endian = false, record_size = 50,
        taxels = { [8] = 25 },
        accelerations = {},
    },
}

return original
