// g++ -std=c++17 -O3 -I include examples/live_frames.cpp -o live_frames && ./live_frames /dev/ttyUSB0 100
// Starts the hub on a serial port (Linux), prints taxel frames, and stops the hub after the given number of frames.
#include <cstdio>
#include <cstdlib>
#include <fcntl.h>
#include <poll.h>
#include <stdexcept>
#include <string>
#include <taxel/taxel.hpp>
#include <termios.h>
#include <unistd.h>

namespace
{
class Port
{
  public:
    explicit Port(const char *path) : handle_(open(path, O_RDWR | O_NOCTTY))
    {
        termios settings{};
        if (handle_ < 0 || tcgetattr(handle_, &settings))
            throw std::runtime_error(std::string(path) + ": is no serial port that can be opened");
        cfmakeraw(&settings); // 8 data bits, no parity, 1 stop bit
        settings.c_cflag |= CLOCAL | CREAD;
        cfsetspeed(&settings, B1000000);
        tcsetattr(handle_, TCSANOW, &settings);
    }
    ~Port()
    {
        close(handle_);
    }
    void send(taxel::FrameType type, const std::uint8_t *payload, std::size_t length)
    {
        const auto bytes = taxel::encode_frame(type, sequence_++, payload, length);
        for (std::size_t sent = 0; sent < bytes.size();) {
            const ssize_t size = write(handle_, &bytes[sent], bytes.size() - sent);
            if (size <= 0)
                throw std::runtime_error("the port accepts no bytes");
            sent += static_cast<std::size_t>(size);
        }
    }
    std::size_t receive(std::uint8_t *buffer, std::size_t size, int timeout_ms)
    {
        pollfd state{handle_, POLLIN, 0};
        if (poll(&state, 1, timeout_ms) == 0)
            return 0;
        const ssize_t received = read(handle_, buffer, size);
        if (received <= 0)
            throw std::runtime_error("the port has vanished");
        return static_cast<std::size_t>(received);
    }

  private:
    int handle_;
    std::uint16_t sequence_ = 0;
};

void send_handshake(Port &port)
{
    std::uint8_t payload[taxel::HostHandshake::size];
    taxel::HostHandshake{1, taxel::PROTOCOL_VERSION_MIN, taxel::PROTOCOL_VERSION}.pack(payload);
    port.send(taxel::FrameType::HOST_HANDSHAKE, payload, sizeof payload);
}

void send_command(Port &port, taxel::Command command, bool is_compact = false)
{
    const std::uint8_t payload[] = {2, static_cast<std::uint8_t>(command),
                                    static_cast<std::uint8_t>(taxel::StartFlag::COMPACT)};
    port.send(taxel::FrameType::COMMAND, payload, is_compact ? 3 : 2); // tag, command, arguments of START
}
} // namespace

int main(int count, char **arguments)
try {
    if (count != 3)
        throw std::runtime_error("usage: live_frames PORT FRAMES");
    Port port(arguments[1]);
    long remaining = std::atol(arguments[2]);
    taxel::Decoder decoder;
    enum { HANDSHAKE, START, NOTHING } next = HANDSHAKE; // what this host sends next
    std::uint8_t version = 0;
    const auto handle = [&](const taxel::Frame &frame) {
        if (frame.type == taxel::FrameType::HUB_HANDSHAKE) {
            const auto answer = frame.as<taxel::HubHandshake>();
            version = answer.version_chosen;
            next = answer.tag == 0 ? HANDSHAKE : START; // tag 0: the hub has restarted
            if (next == START && version == 0)
                throw std::runtime_error("the hub supports no version of the protocol that this client supports");
        } else if (frame.has_counts() && remaining > 0) {
            std::printf("board 0x%02X, cycle %u: taxel 0 has %u counts\n", frame.address, frame.cycle, frame.counts[0]);
            remaining--;
        }
    };
    while (remaining > 0) {
        if (next == HANDSHAKE) {
            send_handshake(port);
        } else if (next == START) {
            decoder.forget_cycles();
            send_command(port, taxel::Command::START, version >= 2);
        }
        std::uint8_t buffer[4096];
        const std::size_t size = port.receive(buffer, sizeof buffer, 1000);
        next = size == 0 ? HANDSHAKE : NOTHING; // silence: the handshake or START was lost
        decoder.push(buffer, size, handle);
        const auto acknowledgements = decoder.take_acknowledgements();
        if (!acknowledgements.empty())
            port.send(taxel::FrameType::ACKNOWLEDGE, acknowledgements.data(), acknowledgements.size());
    }
    send_command(port, taxel::Command::STOP);
    std::printf("%llu frames lost\n", static_cast<unsigned long long>(decoder.losses().lost));
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
