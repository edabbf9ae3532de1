// g++ -std=c++17 -O3 -I include examples/print_frames.cpp -o print_frames && ./print_frames skin.bin
#include <cstdio>
#include <taxel/taxel.hpp>
int main(int count, char **arguments) try {
    taxel::CaptureReader reader(count > 1 ? arguments[1] : "skin.bin");
    taxel::Decoder decoder;
    std::vector<std::uint8_t> bytes;
    for (std::uint64_t time_ns = 0; reader.next(time_ns, bytes);)
        decoder.push(bytes.data(), bytes.size(), [&](const taxel::Frame &frame) {
            if (frame.taxel_count) std::printf("%llu 0x%02X %u\n", static_cast<unsigned long long>(time_ns), frame.address, frame.counts[0]);
        });
    std::printf("%llu frames, %llu lost\n", static_cast<unsigned long long>(decoder.losses().frames), static_cast<unsigned long long>(decoder.losses().lost));
} catch (const taxel::CaptureError &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
