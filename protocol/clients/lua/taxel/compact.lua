-- Compact snapshots of one board: packed frames and delta frames to counts (SPEC.md, "Coding of compact snapshots").
-- Integers and rounding are part of the protocol.
local bits = require("taxel.bits")
local crc32 = require("taxel.crc32")
local fields = require("taxel.fields")
local protocol = require("taxel.protocol")

local floor, min, max, abs = math.floor, math.min, math.max, math.abs
local band, lshift, rshift = bits.band, bits.lshift, bits.rshift
local COUNT_MAX, WORD = 0xFFFF, 4294967296
local cumulative_table, multipliers = protocol.COMPACT_CUMULATIVE, protocol.COMPACT_MULTIPLIERS
local REACH, ESCAPE = protocol.COMPACT_REACH, protocol.COMPACT_ESCAPE
local MIDDLE = ESCAPE + cumulative_table[#cumulative_table]
local REPEAT_AFTER = 4 -- snapshots that may arrive before an answer takes effect on the board

-- Creates the state of a taxel: mean in 64ths of a count, level of the scale, and values that follow from the level.
local function new_taxel(mean, level)
    local octave = rshift(level, 6)
    return { mean = mean, level = level, octave = octave, multiplier = multipliers[rshift(level, 3) % 8 + 1],
        raw_bits = max(octave - protocol.COMPACT_COARSE_OCTAVE, 0) }
end

-- Returns the predicted count.
local function compute_centre(taxel)
    return min(floor((taxel.mean + 32) / 64), COUNT_MAX)
end

-- Converts a magnitude in 64ths of a count to 1024ths of the taxel's scale.
local function compute_distance(taxel, difference)
    return rshift(difference * taxel.multiplier, taxel.octave)
end

-- Returns the probability of all counts below `symbol` (a count without its raw bits) and of the escape, in 2^-16.
local function compute_cumulative(taxel, symbol)
    local difference = lshift(symbol, taxel.raw_bits + 6) - 32 - taxel.mean
    local size = min(compute_distance(taxel, abs(difference)), REACH)
    local corner, fraction = rshift(size, 7), size % 128
    local share = cumulative_table[corner + 1]
    if fraction > 0 then
        share = share + rshift((cumulative_table[corner + 2] - share) * fraction, 7)
    end
    return difference < 0 and MIDDLE - share or MIDDLE + share
end

-- Returns the largest corner of the cumulative table, 0 to 63, with at most this share.
local function find_corner(share)
    local low, high = 0, 63
    while low < high do
        local middle = floor((low + high + 1) / 2)
        if cumulative_table[middle + 1] <= share then
            low = middle
        else
            high = middle - 1
        end
    end
    return low
end

-- Returns a symbol at or below the symbol of the probability `target`, at most a few symbols away: the end of the
-- segment of the cumulative table that contains the target.
local function find_first_symbol(taxel, target)
    local from, step, edge = taxel.mean + 32, lshift(1, 7 + taxel.octave), nil
    if target >= MIDDLE then
        edge = from + floor(find_corner(target - MIDDLE) * step / taxel.multiplier)
    else
        local corner = find_corner(MIDDLE - target - 1) + 1
        edge = max(from - floor((corner * step + taxel.multiplier - 1) / taxel.multiplier), 0)
    end
    return min(rshift(edge, taxel.raw_bits + 6), rshift(COUNT_MAX, taxel.raw_bits))
end

-- Rounds the difference between count and centre as a board stores it in one byte: exact below 64, else the middle of
-- its quarter of an octave.
local function quantise(size)
    local shift = 0
    if size >= 64 then
        while rshift(size, shift) >= 8 do
            shift = shift + 1
        end
        return lshift(rshift(size, shift), shift) + rshift(lshift(1, shift), 1)
    end
    return size
end

-- Returns the state after one more key frame. gain: weight of the new count, in 256ths.
local function update(taxel, count, gain)
    local centre = compute_centre(taxel)
    local size = quantise(abs(count - centre))
    local difference = 64 * (centre + (count < centre and -size or size)) - taxel.mean
    local magnitude, sign = abs(difference), difference < 0 and -1 or 1
    local scales, mean, level = compute_distance(taxel, magnitude), nil, taxel.level
    if scales >= protocol.COMPACT_JUMP then
        mean = taxel.mean + difference
    else
        local spread = rshift(min(scales, protocol.COMPACT_CLIP) * protocol.COMPACT_MEAN_DEVIATION, 10)
        local excess = spread - protocol.COMPACT_UNIT
        local step = rshift(abs(excess) * gain * protocol.COMPACT_LEVEL_STEP + 131072, 18)
        level = min(max(level + (excess < 0 and -step or step), 0), protocol.COMPACT_LEVEL_MAX)
        mean = taxel.mean + sign * rshift(magnitude * gain + 128, 8)
    end
    return new_taxel(min(max(mean, 0), protocol.COMPACT_MEAN_MAX), level)
end

-- Decoder of a range coder (Martin, 1979). Bytes after the last one are zeros.
local RangeDecoder = {}
RangeDecoder.__index = RangeDecoder

-- Creates a decoder of the coded bytes of a delta frame.
local function new_range_decoder(data)
    local decoder = setmetatable({ data = data, position = 0, code = 0, range = WORD - 1 }, RangeDecoder)
    for _ = 1, 4 do
        decoder:shift_in_byte()
    end
    return decoder
end

-- Moves the next byte into the code.
function RangeDecoder:shift_in_byte()
    self.position = self.position + 1
    self.code = (self.code * 256 + (self.data:byte(self.position) or 0)) % WORD
end

-- Returns the next of 2^count equal shares, without consuming it. Damaged bytes alone point behind the last one.
function RangeDecoder:peek(count)
    return min(floor(self.code / rshift(self.range, count)), lshift(1, count) - 1)
end

-- Consumes the symbol with the interval from `first` on with `size` of 2^count equal shares.
function RangeDecoder:take(first, size, count)
    local share = rshift(self.range, count)
    self.code = (self.code - first * share) % WORD
    self.range = size * share
    while self.range < 16777216 do
        self:shift_in_byte()
        self.range = self.range * 256
    end
end

-- Decodes and consumes an uncoded number.
function RangeDecoder:take_bits(count)
    local value = self:peek(count)
    self:take(value, 1, count)
    return value
end

-- Decodes a count too far from its prediction; returns nil for bytes that no encoder produces.
function RangeDecoder:take_escape(taxel)
    self:take(0, ESCAPE, 16)
    local head = self:take_bits(5)
    local exponent = rshift(head, 1)
    local size = lshift(1, exponent) + self:take_bits(exponent)
    local count = compute_centre(taxel) + (head % 2 == 1 and -size or size)
    return count >= 0 and count <= COUNT_MAX and count or nil
end

-- Decodes the next count; returns nil for bytes that no encoder produces.
function RangeDecoder:take_count(taxel)
    local target = self:peek(16)
    if target < ESCAPE then
        return self:take_escape(taxel)
    end
    local symbol, last = find_first_symbol(taxel, target), rshift(COUNT_MAX, taxel.raw_bits)
    local first, following = compute_cumulative(taxel, symbol), compute_cumulative(taxel, symbol + 1)
    while following <= target and symbol < last do
        symbol = symbol + 1
        first, following = following, compute_cumulative(taxel, symbol + 1)
    end
    if target < first or target >= following then
        return nil
    end
    self:take(first, following - first, 16)
    return lshift(symbol, taxel.raw_bits) + self:take_bits(taxel.raw_bits)
end

-- Decodes the counts of a delta frame; returns nil for bytes that no encoder produces.
local function decode_counts(taxels, data)
    local decoder, counts = new_range_decoder(data), {}
    for i, taxel in ipairs(taxels) do
        counts[i] = decoder:take_count(taxel)
        if not counts[i] then
            return nil
        end
    end
    return counts
end

-- Unpacks the counts of a packed frame, each of `width` bits, lowest bits first.
local function unpack_counts(data, width, taxel_count)
    local counts, buffer, available, position = {}, 0, 0, 0
    for i = 1, taxel_count do
        while available < width do
            position = position + 1
            buffer = buffer + lshift(data:byte(position), available)
            available = available + 8
        end
        counts[i] = buffer % lshift(1, width)
        buffer = rshift(buffer, width)
        available = available - width
    end
    return counts
end

local Receiver = {}
Receiver.__index = Receiver

local compact = {}

-- Creates the state of the compact snapshots of one board: key_frame and pending, each {id, timestamp_us, updates, taxels}
-- or nil; answer: "acknowledge" or "forget" that the host has to send, or nil.
function compact.new_receiver()
    return setmetatable({ snapshots_until_repeat = 0 }, Receiver)
end

-- Stores an answer to be sent.
function Receiver:set_answer(answer)
    self.answer, self.snapshots_until_repeat = answer, REPEAT_AFTER
end

-- Stores an answer again if several snapshots have arrived without its effect.
function Receiver:repeat_answer(answer)
    if self.snapshots_until_repeat > 0 then
        self.snapshots_until_repeat = self.snapshots_until_repeat - 1
    else
        self:set_answer(answer)
    end
end

-- Decodes a compact snapshot, the bytes from `sequence` to `crc32`. Returns counts and the board's time; nil and
-- "damaged" or "no key frame" without counts.
function Receiver:receive(address, taxel_count, data)
    if #data < protocol.COMPACT_OVERHEAD_DELTA or taxel_count == 0 or taxel_count > protocol.COMPACT_TAXELS_MAX then
        return nil, "damaged"
    end
    local content, format = data:sub(1, -5), data:byte(3)
    local crc = crc32(content, crc32(string.char(address)))
    local width, start = band(format, protocol.COMPACT_WIDTH_MASK), band(format, protocol.COMPACT_START_MASK)
    local is_key_frame = band(format, protocol.COMPACT_KEY_FRAME) ~= 0
    if crc ~= fields.read_number(data, #content, 4) or width > 16 or (start ~= 0 and not (width > 0 and is_key_frame)) then
        return nil, "damaged"
    end
    local counts, time, next_key_frame
    if width > 0 then
        counts, time, next_key_frame = self:receive_packed(content, taxel_count, width, start, is_key_frame)
    else
        counts, time, next_key_frame = self:receive_delta(content, taxel_count, is_key_frame)
    end
    if counts and is_key_frame then
        next_key_frame.id, next_key_frame.timestamp_us = crc % 65536, time
        if self.key_frame and self.key_frame.id == next_key_frame.id then
            self.pending = nil -- no board marks a snapshot whose id equals that of the key frame in use
        else
            self.pending = next_key_frame
            self:set_answer("acknowledge")
        end
    end
    return counts, time
end

-- Decodes a packed frame. Returns counts, time and, if it is marked as one, the next key frame.
function Receiver:receive_packed(content, taxel_count, width, start, is_key_frame)
    local head = fields.unpack("compact_packed", content)
    local size = protocol.structs.compact_packed.size
    if #content < size + floor((width * taxel_count + 7) / 8) then
        return nil, "damaged"
    end
    local counts = unpack_counts(content:sub(size + 1), width, taxel_count)
    if not is_key_frame then
        return counts, head.timestamp_us
    end
    self.key_frame = nil -- the board has discarded its earlier key frame
    local level = protocol.COMPACT_LEVEL_START
        + protocol.COMPACT_LEVEL_START_STEP * rshift(start, protocol.COMPACT_START_SHIFT)
    local taxels = {}
    for i, count in ipairs(counts) do
        taxels[i] = new_taxel(64 * count, level)
    end
    return counts, head.timestamp_us, { updates = 1, taxels = taxels }
end

-- Decodes a delta frame against the key frame that it names. Returns the same values.
function Receiver:receive_delta(content, taxel_count, is_key_frame)
    local head, size = fields.unpack("compact_delta", content), protocol.structs.compact_delta.size
    if self.pending and self.pending.id == head.key_frame then -- the board has received the acknowledgement
        self.key_frame, self.pending, self.answer = self.pending, nil, nil
    end
    local key_frame, counts = self.key_frame, nil
    if key_frame and key_frame.id == head.key_frame and #key_frame.taxels == taxel_count then
        counts = decode_counts(key_frame.taxels, content:sub(size + 1))
    end
    if not counts then
        return self:reject_delta()
    end
    local low = fields.read_number(head.timestamp_low, 0, 3)
    local time = (key_frame.timestamp_us + (low - key_frame.timestamp_us) % 16777216) % WORD
    if not is_key_frame then
        if self.pending then
            self:repeat_answer("acknowledge")
        end
        return counts, time
    end
    local gain, taxels = protocol.COMPACT_GAINS[key_frame.updates], {}
    for i, count in ipairs(counts) do
        taxels[i] = update(key_frame.taxels[i], count, gain)
    end
    return counts, time, { updates = min(key_frame.updates + 1, #protocol.COMPACT_GAINS), taxels = taxels }
end

-- Discards both key frames after a delta frame that cannot be decoded, and reports this to the board.
function Receiver:reject_delta()
    if self.key_frame or self.pending then
        self.key_frame, self.pending, self.snapshots_until_repeat = nil, nil, 0
    end
    self:repeat_answer("forget")
    return nil, "no key frame"
end

-- Returns the answer as 3 bytes of an ACKNOWLEDGE payload, which then counts as sent; "" if there is none.
function Receiver:take_answer(address)
    local answer = self.answer
    self.answer = nil
    if answer == "forget" then
        return string.char(address + protocol.ACKNOWLEDGE_FORGET, 0, 0)
    elseif answer then
        return string.char(address, self.pending.id % 256, rshift(self.pending.id, 8))
    end
    return ""
end

return compact
