-- CRC-32 of IEEE 802.3, as crc32() of zlib.
local bits = require("taxel.bits")

local bxor, band, rshift = bits.bxor, bits.band, bits.rshift
local remainders = {}
for byte = 0, 255 do
    local remainder = byte
    for _ = 1, 8 do
        remainder = bxor(rshift(remainder, 1), remainder % 2 == 1 and 0xEDB88320 or 0)
    end
    remainders[byte] = remainder
end

-- Computes the CRC-32 of the bytes `first` to `last` of a string. crc: CRC-32 of the bytes before them, 0 at the start.
return function(data, crc, first, last)
    local state = bxor(crc or 0, 0xFFFFFFFF)
    for i = first or 1, last or #data do
        state = bxor(rshift(state, 8), remainders[band(bxor(state, data:byte(i)), 0xFF)])
    end
    return bxor(state, 0xFFFFFFFF)
end
