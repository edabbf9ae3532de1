-- Run in the folder above: lua5.4 examples/print_frames.lua skin.bin
package.path = "./?.lua;" .. package.path
local capture, decoder = require("taxel.capture"), require("taxel.decoder")
local stream = decoder.new()
local function print_frame(frame)
    if frame.counts and frame.counts[1] then
        print(string.format("board 0x%02X, cycle %d: taxel 0 has %d counts", frame.address, frame.cycle, frame.counts[1]))
    end
end
capture.read(arg[1] or "skin.bin", function(bytes, time_ns)
    stream:push(bytes, print_frame)
end)
stream:finish(print_frame) -- a capture can end before the delimiter of its last frame
print(stream.losses.lost .. " frames lost")
