-- Dissector for Wireshark and tshark. A packet contains bytes of the hub's stream in their order (`taxel convert x.bin
-- x.pcapng` writes them with link type USER0); a frame may extend over several packets and is shown in its last packet.
local crc_status = { [0] = "right", [1] = "wrong" }
local decoder = require("taxel.decoder")
local fields = require("taxel.fields")
local framing = require("taxel.framing")
local protocol = require("taxel.protocol")

local proto = Proto("taxel", "Taxel tactile skin")
local pf, info = {}, {}
local FIELD_TYPES = { [1] = ProtoField.uint8, [2] = ProtoField.uint16, [4] = ProtoField.uint32, [8] = ProtoField.uint64 }
-- Enumerations of fields that hold a code, by field name.
local CODES = { reset_cause = "ResetCause", last_fault = "BoardFault", fault = "BoardFault", state = "BoardState",
    status = "ReplyStatus", command = "Command", level = "LogLevel", code = "LogCode" }

local frame_names = {}
for code, rule in pairs(protocol.frames) do
    frame_names[code] = rule.name
end

info.type = ProtoField.uint8("taxel.type", "Type", base.HEX, frame_names)
info.sequence = ProtoField.uint16("taxel.sequence", "Sequence")
info.lost = ProtoField.uint16("taxel.lost", "Frames lost before this frame")
info.flags = ProtoField.uint8("taxel.flags", "Flags", base.HEX)
info.board_crc = ProtoField.uint8("taxel.board_crc", "CRC of the board", base.DEC, crc_status)
info.address = ProtoField.uint8("taxel.address", "Address", base.HEX)
info.missing = ProtoField.uint16("taxel.missing", "Frames of this board missing before this frame")
info.board_time = ProtoField.uint32("taxel.board_time_us", "Time of the board (us)")
info.counts = ProtoField.string("taxel.counts", "Raw counts")
info.tail = ProtoField.bytes("taxel.tail", "Data")
info.text = ProtoField.string("taxel.text", "Text")
info.unknown = ProtoField.uint32("taxel.unknown", "Frames of a newer version")
info.discarded = ProtoField.uint32("taxel.discarded", "Bytes of no frame")

-- Creates one field of Wireshark per field of a struct: taxel.STRUCT.FIELD.
local function register_struct(struct)
    for _, field in ipairs(protocol.structs[struct]) do
        local name = struct .. "." .. field.name
        if not pf[name] then
            local label = field.name:gsub("_", " ")
            if field.is_bytes then
                pf[name] = ProtoField.bytes("taxel." .. name, label)
            elseif CODES[field.name] then
                pf[name] = FIELD_TYPES[field.size]("taxel." .. name, label, base.DEC, protocol.names[CODES[field.name]])
            else
                pf[name] = FIELD_TYPES[field.size]("taxel." .. name, label)
            end
        end
    end
end

local all = {}
for _, rule in pairs(protocol.frames) do
    for _, part in ipairs(rule.parts) do
        register_struct(part.struct)
    end
end
for _, group in ipairs({ pf, info }) do
    for _, field in pairs(group) do
        all[#all + 1] = field
    end
end
proto.fields = all

local lost_expert = ProtoExpert.new("taxel.expert.lost", "Frames were lost before this frame", expert.group.SEQUENCE,
    expert.severity.WARN)
local crc_expert = ProtoExpert.new("taxel.expert.board_crc", "The board's CRC is wrong", expert.group.CHECKSUM,
    expert.severity.ERROR)
local key_expert = ProtoExpert.new("taxel.expert.key_frame", "The key frame of this delta frame is not in the capture",
    expert.group.UNDECODED, expert.severity.NOTE)
local restart_expert = ProtoExpert.new("taxel.expert.restart", "The hub has restarted", expert.group.SEQUENCE,
    expert.severity.NOTE)
local discarded_expert = ProtoExpert.new("taxel.expert.discarded", "Bytes that belong to no frame",
    expert.group.MALFORMED, expert.severity.WARN)
proto.experts = { lost_expert, crc_expert, key_expert, restart_expert, discarded_expert }

-- State of the capture: a decoder for each direction, and the frames of each packet, found in the first pass.
local streams, packets

function proto.init()
    streams, packets = {}, {}
end

-- Returns the frames that end in this packet, and the number of bytes of no frame. Packets are decoded once, in order.
local function decode_packet(number, data, direction)
    if not packets[number] then
        local stream = streams[direction] or decoder.new(direction)
        local before, frames, unknown = stream.deframer.discarded_bytes, {}, stream.losses.unknown
        streams[direction] = stream
        stream:push(data, function(frame)
            if frame.counts then -- as text: a table of numbers takes ten times the memory
                frame.counts = table.concat(frame.counts, ",")
            end
            frames[#frames + 1] = frame
        end)
        packets[number] = { frames = frames, discarded = stream.deframer.discarded_bytes - before,
            unknown = stream.losses.unknown - unknown }
    end
    return packets[number]
end

-- Adds the fields of the structs at the front of a payload; returns the bytes of these structs.
local function add_fields(tree, frame, buffer)
    return fields.visit_payload(frame.code, function(struct, _, field, offset)
        tree:add_le(pf[struct .. "." .. field.name], buffer(offset + field.offset, field.size))
    end)
end

-- Adds the decoded content of a taxel frame.
local function add_taxels(tree, frame)
    tree:add(info.address, frame.address):set_generated()
    tree:add(info.missing, frame.missing_before):set_generated()
    tree:add(info.board_time, frame.board_time_us):set_generated()
    tree:add(info.board_crc, frame.flags % 2):set_generated()
    if frame.counts ~= "" then
        tree:add(info.counts, frame.counts):set_generated()
    end
end

-- Adds the expert information about losses and damage.
local function add_experts(tree, frame)
    if frame.lost_before > 0 then
        tree:add_proto_expert_info(lost_expert, frame.lost_before .. " frames were lost before this frame")
    end
    if frame.flags == decoder.BOARD_CRC_BAD then
        tree:add_proto_expert_info(crc_expert)
    elseif frame.flags == decoder.NO_KEY_FRAME then
        tree:add_proto_expert_info(key_expert)
    elseif frame.flags == decoder.HUB_RESTARTED then
        tree:add_proto_expert_info(restart_expert)
    end
end

-- Returns the text of a frame for the column Info.
local function describe(frame)
    if frame.counts then
        local count = select(2, frame.counts:gsub("%d+", ""))
        return string.format("%s 0x%02X, cycle %d, %d counts", frame.type, frame.address, frame.cycle, count)
    end
    return frame.type
end

-- Adds a frame with all its fields.
local function add_frame(tree, frame)
    local buffer = ByteArray.new(fields.to_hex(frame.payload)):tvb("Payload of " .. frame.type)
    local branch = tree:add(proto, buffer(), "Taxel frame, " .. describe(frame))
    branch:add(info.type, frame.code):set_generated()
    branch:add(info.sequence, frame.sequence):set_generated()
    branch:add(info.lost, frame.lost_before):set_generated()
    branch:add(info.flags, frame.flags):set_generated()
    local size = add_fields(branch, frame, buffer)
    if frame.type == "LOG" then
        branch:add(info.text, buffer(size))
    elseif frame.counts then
        add_taxels(branch, frame)
    elseif size < buffer:len() then
        branch:add(info.tail, buffer(size))
    end
    add_experts(branch, frame)
end

function proto.dissector(buffer, pinfo, tree)
    local direction = pinfo.p2p_dir == P2P_DIR_SENT and framing.TO_HUB or framing.TO_HOST
    local packet = decode_packet(pinfo.number, buffer:raw(), direction)
    local texts = {}
    for i, frame in ipairs(packet.frames) do
        add_frame(tree, frame)
        texts[i] = describe(frame)
    end
    if packet.unknown > 0 then
        local branch = tree:add(proto, buffer(), "Frames that this version does not define: " .. packet.unknown)
        branch:add(info.unknown, packet.unknown):set_generated()
        texts[#texts + 1] = packet.unknown .. " unknown frames"
    end
    if packet.discarded > 0 then
        local branch = tree:add(proto, buffer(), "Bytes that belong to no frame: " .. packet.discarded)
        branch:add(info.discarded, packet.discarded):set_generated()
        branch:add_proto_expert_info(discarded_expert)
        texts[#texts + 1] = packet.discarded .. " bytes of no frame"
    elseif #texts == 0 then
        tree:add(proto, buffer(), "Part of a taxel frame")
        texts[1] = "part of a frame"
    end
    pinfo.cols.protocol = "TAXEL"
    pinfo.cols.info = table.concat(texts, "; ")
    return buffer:len()
end

-- Link type USER0 belongs to no protocol; with other captures, "Decode as" or the table DLT_USER selects this dissector.
DissectorTable.get("wtap_encap"):add(wtap.USER0, proto)
