-- Prints decoded frames as text lines, which the tests compare with the decoder in Python.
--
--     lua dump.lua capture FILE      the frames of a capture file, then its losses
--     lua dump.lua vectors           for each line of the standard input: "stream DIRECTIONS HEX", "register STRUCT HEX"
--                                    or "original FORMAT HEX"
package.path = arg[0]:gsub("[^/]*$", "") .. "../?.lua;" .. package.path
local capture = require("taxel.capture")
local decoder = require("taxel.decoder")
local fields = require("taxel.fields")
local original = require("taxel.original")
local protocol = require("taxel.protocol")

-- Formats the value of a field.
local function format_value(field, data, offset)
    local value = fields.read(field, data, offset)
    return field.is_bytes and fields.to_hex(value) or tostring(value)
end

-- Prints a frame.
local function print_frame(frame)
    local line = { string.format("frame type=%s sequence=%d lost=%d flags=%d", frame.type, frame.sequence,
        frame.lost_before, frame.flags) }
    local size = fields.visit_payload(frame.code, function(_, prefix, field, offset)
        line[#line + 1] = " " .. prefix .. field.name .. "=" .. format_value(field, frame.payload, offset)
    end)
    if frame.counts then
        line[#line + 1] = string.format(" missing=%d board_time_us=%d counts=", frame.missing_before, frame.board_time_us)
        line[#line + 1] = table.concat(frame.counts, ",")
    else
        line[#line + 1] = " tail=" .. fields.to_hex(frame.payload:sub(size + 1))
    end
    print(table.concat(line))
end

-- Prints the counters of a stream and of its boards, and the pending acknowledgements.
local function print_losses(stream)
    local losses = stream.losses
    print(string.format("end frames=%d lost=%d restarts=%d unknown=%d discarded=%d answers=%s", losses.frames, losses.lost,
        losses.restarts, losses.unknown, stream.deframer.discarded_bytes, fields.to_hex(stream:take_acknowledgements())))
    for _, address in ipairs(stream:list_addresses()) do
        local board = stream.boards[address]
        print(string.format("board address=%d received=%d missing=%d damaged=%d undecoded=%d", address, board.received,
            board.missing, board.damaged, board.undecoded))
    end
end

-- Prints the frames and losses of a capture file.
local function dump_capture(path)
    local stream = decoder.new()
    local is_complete, problem = pcall(capture.read, path, function(bytes)
        stream:push(bytes, print_frame)
    end)
    if not is_complete then
        io.stderr:write(problem, "\n")
        os.exit(1)
    end
    stream:finish(print_frame)
    print_losses(stream)
end

-- Prints the messages of a stream of the original hub.
local function dump_original(name, data)
    local stream, half = original.new_decoder(original.formats[name]), math.floor(#data / 2)
    local function print_message(message)
        print(string.format("message address=%d time=%d plausible=%d position=%d counts=%s accelerations=%s",
            message.address, message.timestamp_ms or 0, message.is_time_plausible and 1 or 0, message.position,
            table.concat(message.counts, ","), table.concat(message.accelerations, ",")))
    end
    stream:push(data:sub(1, half), print_message) -- the result does not depend on the pieces
    stream:push(data:sub(half + 1), print_message)
    stream:finish(print_message)
    print(string.format("end discarded=%d rejected=%d ambiguous=%d", stream.discarded_bytes, stream.rejected_candidates,
        stream.ambiguous_candidates))
end

-- Prints the decoded content of one line of the standard input.
local function dump_vector(kind, which, data)
    if kind == "register" then
        local line, struct = { "register" }, protocol.structs[which]
        for _, field in ipairs(struct) do
            line[#line + 1] = " " .. field.name .. "=" .. format_value(field, data, 0)
        end
        print(table.concat(line) .. " bytes=" .. fields.to_hex(data:sub(1, struct.size)))
        return
    end
    if kind == "original" then
        return dump_original(which, data)
    end
    local stream = decoder.new(tonumber(which))
    stream:push(data, print_frame)
    stream:finish(print_frame)
    print_losses(stream)
end

if arg[1] == "capture" then
    dump_capture(arg[2])
else
    for line in io.lines() do
        local kind, which, hex = line:match("(%S+) (%S+) (%S+)")
        dump_vector(kind, which, hex == "-" and "" or (hex:gsub("..", function(digits)
            return string.char(tonumber(digits, 16))
        end)))
    end
end
