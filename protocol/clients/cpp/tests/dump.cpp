/* Prints decoded frames as text lines, which the tests compare with the decoder in Python.
 *
 *     dump capture FILE      the frames of a capture file, then its losses
 *     dump vectors           for each line of the standard input: "stream DIRECTIONS HEX", "register STRUCT HEX"
 *                            or "original FORMAT HEX"
 */
#include <iostream>
#include <string>

#include "taxel/taxel.hpp"

namespace
{

const char DIGITS[] = "0123456789abcdef";

/* Formats bytes as hexadecimal digits. */
std::string to_hex(const std::uint8_t *bytes, std::size_t size)
{
    std::string text;
    for (std::size_t i = 0; i < size; i++) {
        text += DIGITS[bytes[i] >> 4];
        text += DIGITS[bytes[i] & 15];
    }
    return text;
}

/* Parses hexadecimal digits. */
std::vector<std::uint8_t> from_hex(const std::string &text)
{
    std::vector<std::uint8_t> bytes;
    for (std::size_t i = 0; i + 1 < text.size(); i += 2) {
        bytes.push_back(static_cast<std::uint8_t>(std::stoi(text.substr(i, 2), nullptr, 16)));
    }
    return bytes;
}

/* Formats numbers with commas between them. */
template <class Number> std::string join(const Number *numbers, std::size_t size)
{
    std::string text;
    for (std::size_t i = 0; i < size; i++) {
        text += (i ? "," : "") + std::to_string(numbers[i]);
    }
    return text;
}

/* Visitor of the fields of a struct, which appends " name=value" to a line. */
struct FieldPrinter {
    std::string &line;
    std::string prefix;

    template <class Integer> void operator()(const char *name, Integer value)
    {
        line += " " + prefix + name + "=" + std::to_string(value);
    }
    template <std::size_t N> void operator()(const char *name, const std::array<std::uint8_t, N> &value)
    {
        line += " " + prefix + name + "=" + to_hex(value.data(), N);
    }
};

/* Encodes a decoded frame again from its fields, so that both directions of the generated code are tested. */
std::string encode_again(const taxel::Frame &frame)
{
    std::vector<std::uint8_t> payload(frame.payload, frame.payload + frame.length);
    std::size_t offset = 0;
    taxel::visit_payload(frame.type, frame.payload, [&](const char *, const auto &value) {
        value.pack(payload.data() + offset);
        offset += value.size;
    });
    const auto wire = taxel::encode_frame(frame.type, frame.sequence, payload.data(), payload.size());
    return to_hex(wire.data(), wire.size());
}

/* Prints a frame; with_wire: also its encoding from the decoded fields. */
void print_frame(const taxel::Frame &frame, bool with_wire)
{
    std::string line = std::string("frame type=") + taxel::to_string(frame.type) +
                       " sequence=" + std::to_string(frame.sequence) + " lost=" + std::to_string(frame.lost_before) +
                       " flags=" + std::to_string(frame.flags);
    const std::size_t size =
        taxel::visit_payload(frame.type, frame.payload,
                             [&](const char *prefix, const auto &value) { value.visit(FieldPrinter{line, prefix}); });
    if (frame.counts) {
        line += " missing=" + std::to_string(frame.missing_before) +
                " board_time_us=" + std::to_string(frame.board_time_us) +
                " counts=" + join(frame.counts, frame.taxel_count);
    } else {
        line += " tail=" + to_hex(frame.payload + size, frame.length - size);
    }
    if (with_wire) {
        line += " wire=" + encode_again(frame);
    }
    std::cout << line << '\n';
}

/* Prints the counters of a stream and of its boards, and the pending acknowledgements. */
void print_losses(taxel::Decoder &decoder)
{
    const taxel::Losses &losses = decoder.losses();
    const auto answers = decoder.take_acknowledgements();
    std::cout << "end frames=" << losses.frames << " lost=" << losses.lost << " restarts=" << losses.restarts
              << " unknown=" << losses.unknown << " discarded=" << decoder.discarded_bytes()
              << " answers=" << to_hex(answers.data(), answers.size()) << '\n';
    for (std::size_t address = 0; address < taxel::ADDRESSES; address++) {
        const auto &board = losses.boards[address];
        if (board.received + board.damaged + board.undecoded) {
            std::cout << "board address=" << address << " received=" << board.received << " missing=" << board.missing
                      << " damaged=" << board.damaged << " undecoded=" << board.undecoded << '\n';
        }
    }
}

/* Prints the frames and losses of a capture file. */
void dump_capture(const char *path)
{
    taxel::CaptureReader reader(path);
    taxel::Decoder decoder;
    taxel::CaptureRecord record;
    const auto print = [](const taxel::Frame &frame) { print_frame(frame, false); };
    while (reader.next(record)) {
        decoder.push(record.bytes, record.size, print);
    }
    decoder.finish(print);
    print_losses(decoder);
}

/* Prints the messages of a stream of the original hub. */
void dump_original(const std::string &name, const std::vector<std::uint8_t> &bytes)
{
    for (const taxel::OriginalFormat &format : taxel::original_formats) {
        if (name != format.name) {
            continue;
        }
        taxel::OriginalDecoder decoder(format);
        const auto print = [](const taxel::OriginalMessage &message) {
            std::cout << "message address=" << unsigned{message.address} << " time=" << message.timestamp_ms
                      << " plausible=" << message.is_time_plausible << " position=" << message.position
                      << " counts=" << join(message.counts, message.taxel_count)
                      << " accelerations=" << join(message.accelerations, message.acceleration_count) << '\n';
        };
        const std::size_t half = bytes.size() / 2; /* two pieces: the result does not depend on them */
        decoder.push(bytes.data(), half, print);
        decoder.push(bytes.data() + half, bytes.size() - half, print);
        decoder.finish(print);
        std::cout << "end discarded=" << decoder.discarded_bytes() << " rejected=" << decoder.rejected_candidates()
                  << " ambiguous=" << decoder.ambiguous_candidates() << '\n';
    }
}

/* Prints the decoded content of one line of the standard input. */
void dump_vector(const std::string &kind, const std::string &which, const std::vector<std::uint8_t> &bytes)
{
    if (kind == "register") {
        std::string line = "register";
        const bool is_defined = taxel::visit_struct(which, bytes.data(), bytes.size(), [&](const auto &value) {
            std::vector<std::uint8_t> packed(value.size);
            value.pack(packed.data());
            value.visit(FieldPrinter{line, ""});
            line += " bytes=" + to_hex(packed.data(), packed.size());
        });
        std::cout << (is_defined ? line : "unknown " + which) << '\n';
        return;
    }
    if (kind == "original") {
        dump_original(which, bytes);
        return;
    }
    taxel::Decoder decoder(static_cast<unsigned>(std::stoi(which)));
    const auto print = [](const taxel::Frame &frame) { print_frame(frame, true); };
    decoder.push(bytes.data(), bytes.size(), print);
    decoder.finish(print);
    print_losses(decoder);
}

} // namespace

int main(int count, char **arguments)
{
    std::ios::sync_with_stdio(false);
    try {
        if (count == 3 && std::string(arguments[1]) == "capture") {
            dump_capture(arguments[2]);
            return 0;
        }
        std::string kind, which, hex;
        while (std::cin >> kind >> which >> hex) {
            dump_vector(kind, which, from_hex(hex));
        }
    } catch (const taxel::CaptureError &error) {
        std::cerr << error.what() << '\n';
        return 1;
    }
    return 0;
}
