// g++ -std=c++17 -O3 -I include examples/print_frames.cpp -o print_frames && ./print_frames skin.bin
#include <cstdio>
#include <taxel/taxel.hpp>
int main(int count, char **arguments)
try {
    taxel::CaptureReader reader(count > 1 ? arguments[1] : "skin.bin");
    taxel::Decoder decoder;
    taxel::CaptureRecord record;
    const auto print = [](const taxel::Frame &frame) {
        if (frame.has_counts())
            std::printf("board 0x%02X, cycle %u: taxel 0 has %u counts\n", frame.address, frame.cycle, frame.counts[0]);
    };
    while (reader.next(record))
        decoder.push(record.bytes, record.size, print);
    decoder.finish(print); // a capture can end before the delimiter of its last frame
    std::printf("%llu frames lost\n", static_cast<unsigned long long>(decoder.losses().lost));
} catch (const taxel::CaptureError &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
