/* The C++ client as a library for tools/bench/bench_clients.py. */
#include <taxel/taxel.hpp>

/* Decodes a capture file; returns the number of frames, 0 if the file cannot be read. `counts`: number of raw counts. */
extern "C" std::uint64_t taxel_client_decode(const char *path, std::uint64_t *counts)
try {
    taxel::CaptureReader reader(path);
    taxel::Decoder decoder;
    taxel::CaptureRecord record;
    const auto add = [&](const taxel::Frame &frame) { *counts += frame.taxel_count; };
    while (reader.next(record)) {
        decoder.push(record.bytes, record.size, add);
    }
    decoder.finish(add);
    return decoder.losses().frames;
} catch (const taxel::CaptureError &) {
    return 0;
}
