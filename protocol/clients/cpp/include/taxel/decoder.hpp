/* Stream decoder: bytes of the hub in, frames with counts and losses out.
 *
 *     taxel::Decoder decoder;
 *     decoder.push(bytes, size, [](const taxel::Frame &frame) {
 *         use(frame.address, frame.counts, frame.taxel_count);
 *     });
 */
#ifndef TAXEL_CLIENT_DECODER_HPP
#define TAXEL_CLIENT_DECODER_HPP

#include <memory>

#include "taxel/compact.hpp"
#include "taxel/framing.hpp"

namespace taxel
{

constexpr std::size_t ADDRESSES = 128;

/* Properties of a frame, as bits. */
enum FrameFlag : std::uint8_t {
    BOARD_CRC_BAD = 1, /* the frame's CRC is correct, the board's own CRC-32 is wrong */
    HUB_RESTARTED = 2, /* the hub has restarted: its sequence begins at 0 */
    NO_KEY_FRAME = 4,  /* a delta frame whose key frame this host does not have: no counts */
};

/* One frame. Pointers stay valid during the call of the handler. The members from `address` on belong to taxel frames.
 */
struct Frame {
    FrameType type;
    std::uint16_t sequence;
    std::uint16_t lost_before; /* frames that the hub sent between the previous frame and this frame */
    std::uint8_t flags;        /* bits of FrameFlag */
    const std::uint8_t *payload;
    std::size_t length;
    std::uint64_t stream_position; /* bytes of the stream up to the delimiter behind this frame */

    std::uint8_t address;
    std::uint16_t cycle;
    std::uint16_t missing_before; /* frames of this board that are missing since its previous frame */
    std::uint16_t board_sequence;
    std::uint32_t hub_time_us, board_time_us;
    const std::uint16_t *counts;
    std::size_t taxel_count; /* 0 if the counts are not available */

    /* Returns whether this is a taxel frame with counts. */
    bool has_counts() const
    {
        return taxel_count != 0;
    }
    /* Returns the payload of a message as its struct, such as frame.as<taxel::HubStatus>(). The caller has compared
     * `type`. */
    template <class Message> Message as() const
    {
        return Message::unpack(payload);
    }
};

/* Counters of a stream; a board's counters have the index of its address. */
struct Losses {
    std::uint64_t frames = 0;
    std::uint64_t lost = 0; /* on the wire: gaps of the frames' sequence */
    std::uint64_t restarts = 0;
    std::uint64_t unknown = 0; /* complete frames that this version does not define */
    struct Board {
        std::uint64_t received = 0;
        std::uint64_t missing = 0;   /* between two received frames, by the poll cycle */
        std::uint64_t damaged = 0;   /* the board's own CRC was wrong */
        std::uint64_t undecoded = 0; /* delta frames without their key frame */
    } boards[ADDRESSES];
};

/* Decoder of one stream. */
class Decoder
{
  public:
    /* Creates a decoder without received bytes. directions: accepted frames, bits of Direction. */
    explicit Decoder(unsigned directions = TO_HOST) : directions_(directions), deframer_(directions)
    {
    }

    /* Takes any number of bytes and calls handler(const Frame &) for each frame that they complete. */
    template <class Handler> void push(const std::uint8_t *bytes, std::size_t size, Handler &&handler)
    {
        deframer_.push(bytes, size, [&](const RawFrame &raw) { deliver(raw, handler); });
    }

    /* Decodes the remaining bytes at the end of a stream. */
    template <class Handler> void finish(Handler &&handler)
    {
        deframer_.finish([&](const RawFrame &raw) { deliver(raw, handler); });
    }

    /* Returns the counters of the stream. */
    const Losses &losses() const
    {
        return losses_;
    }
    /* Returns the number of bytes that were part of no frame; delimiters are not counted. */
    std::uint64_t discarded_bytes() const
    {
        return deframer_.discarded_bytes();
    }

    /* Forgets the poll cycles of all boards. To be called when the host sends START: frames of the interrupted poll
     * cycle then do not count as missing. */
    void forget_cycles()
    {
        for (Board &board : boards_) {
            board.has_cycle = false;
        }
    }

    /* Returns the pending acknowledgements as the payload of an ACKNOWLEDGE frame, which the caller has to send; empty
     * if there are none. */
    std::vector<std::uint8_t> take_acknowledgements()
    {
        std::vector<std::uint8_t> payload;
        for (std::size_t address = 0; address < ADDRESSES; address++) {
            const auto &receiver = boards_[address].receiver;
            const std::size_t end = payload.size() + Acknowledgement::size;
            if (receiver && receiver->answer() != CompactAnswer::NONE &&
                end <= Acknowledgement::size * ACKNOWLEDGE_MAX) {
                payload.resize(end);
                receiver->take_answer(static_cast<std::uint8_t>(address)).pack(&payload[end - Acknowledgement::size]);
            }
        }
        return payload;
    }

  private:
    struct Board {
        bool has_cycle = false;
        std::uint16_t cycle = 0, scan = 0;
        std::unique_ptr<CompactReceiver> receiver;
    };

    /* Decodes a frame of the deframer and calls the handler. */
    template <class Handler> void deliver(const RawFrame &raw, Handler &handler)
    {
        if (!raw.is_known) {
            count_unknown(raw);
            return;
        }
        Frame frame{};
        frame.type = raw.type;
        frame.sequence = raw.sequence;
        frame.payload = raw.payload;
        frame.length = raw.length;
        frame.stream_position = deframer_.position();
        count_sequence(frame);
        if (raw.type == FrameType::TAXELS) {
            decode_taxels(frame);
        } else if (raw.type == FrameType::COMPACT_TAXELS) {
            decode_compact(frame);
        }
        handler(static_cast<const Frame &>(frame));
    }

    /* Counts a frame and the frames that were lost before it. */
    void count_sequence(Frame &frame)
    {
        const bool is_start_of_hub = frame.type == FrameType::HUB_HANDSHAKE && frame.sequence == 0 &&
                                     HubHandshake::unpack(frame.payload).tag == 0;
        if (is_start_of_hub) {
            forget_cycles();
            if (has_sequence_) {
                frame.flags = HUB_RESTARTED;
            }
            losses_.restarts += has_sequence_;
            count_frame(frame.sequence, 0);
        } else {
            const std::uint16_t lost = compute_lost_before(frame.sequence);
            frame.lost_before = static_cast<std::uint16_t>(lost + lost_before_unknown_);
            count_frame(frame.sequence, lost);
        }
        lost_before_unknown_ = 0;
    }

    /* Counts a frame that this version does not define. It takes a number of the sender's sequence, and is no loss; a
     * frame of the other direction has the sequence of another sender. */
    void count_unknown(const RawFrame &raw)
    {
        losses_.unknown++;
        if (is_accepted(raw.type, directions_)) {
            const std::uint16_t lost = compute_lost_before(raw.sequence);
            lost_before_unknown_ = static_cast<std::uint16_t>(lost_before_unknown_ + lost);
            count_frame(raw.sequence, lost);
        }
    }

    /* Returns the number of frames that are missing in the sequence before this frame. */
    std::uint16_t compute_lost_before(std::uint16_t sequence) const
    {
        return has_sequence_ ? static_cast<std::uint16_t>(sequence - next_sequence_) : std::uint16_t{0};
    }

    /* Counts a frame with the number of frames that were lost before it. */
    void count_frame(std::uint16_t sequence, std::uint16_t lost)
    {
        losses_.frames++;
        losses_.lost += lost;
        has_sequence_ = true;
        next_sequence_ = static_cast<std::uint16_t>(sequence + 1);
    }

    /* Decodes a TAXELS frame and checks the CRC of its board. */
    void decode_taxels(Frame &frame)
    {
        const TaxelHeader header = read_header(frame);
        const std::uint8_t *bytes = frame.payload + TaxelHeader::size;
        const SnapshotHeader snapshot = SnapshotHeader::unpack(bytes);
        frame.board_sequence = snapshot.sequence;
        frame.board_time_us = snapshot.timestamp_us;
        frame.taxel_count = header.taxel_count;
        load_counts(bytes + SnapshotHeader::size, header.taxel_count);
        Losses::Board &board = losses_.boards[header.address];
        if (is_board_crc_correct(frame)) {
            board.received++;
        } else {
            frame.flags |= BOARD_CRC_BAD;
            board.damaged++;
        }
        count_cycles(frame, 0);
    }

    /* Copies `size` counts from a snapshot to counts_. */
    void load_counts(const std::uint8_t *bytes, std::size_t size)
    {
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
        /* Pieces of a constant size compile to moves of registers; both arrays have PADDING bytes behind their end. */
        auto *out = reinterpret_cast<std::uint8_t *>(counts_);
        for (std::size_t i = 0; i < size * sizeof counts_[0]; i += detail::PADDING) {
            std::memcpy(out + i, bytes + i, detail::PADDING);
        }
#else
        for (std::size_t i = 0; i < size; i++) {
            detail::load(bytes + 2 * i, counts_[i]);
        }
#endif
    }

    /* Decodes a COMPACT_TAXELS frame. */
    void decode_compact(Frame &frame)
    {
        const TaxelHeader header = read_header(frame);
        const std::uint8_t *bytes = frame.payload + TaxelHeader::size;
        auto &receiver = boards_[header.address].receiver;
        if (!receiver) {
            receiver = std::make_unique<CompactReceiver>();
        }
        frame.board_sequence = CompactHeader::unpack(bytes).sequence;
        Losses::Board &board = losses_.boards[header.address];
        switch (receiver->receive(header.address, header.taxel_count, bytes, frame.length - TaxelHeader::size, counts_,
                                  frame.board_time_us)) {
        case CompactResult::OK:
            frame.taxel_count = header.taxel_count;
            board.received++;
            break;
        case CompactResult::NO_KEY_FRAME:
            frame.flags |= NO_KEY_FRAME;
            frame.board_time_us = 0;
            board.undecoded++;
            break;
        case CompactResult::DAMAGED:
            frame.flags |= BOARD_CRC_BAD;
            board.damaged++;
            break;
        }
        count_cycles(frame, 1);
    }

    /* Copies the header of a taxel frame to `frame`. */
    TaxelHeader read_header(Frame &frame)
    {
        const TaxelHeader header = TaxelHeader::unpack(frame.payload);
        frame.address = header.address;
        frame.cycle = header.cycle;
        frame.hub_time_us = header.hub_time_us;
        frame.counts = counts_;
        return header;
    }

    /* Counts the frames that are missing since the previous frame of the board. No more can be missing than scans were
     * skipped; a board that is polled while it codes a compact snapshot skips one scan without loss (`coding`). */
    void count_cycles(Frame &frame, std::uint16_t coding)
    {
        Board &board = boards_[frame.address];
        if (board.has_cycle) {
            const auto cycles = static_cast<std::uint16_t>(frame.cycle - board.cycle);
            const auto scans = static_cast<std::uint16_t>(frame.board_sequence - board.scan);
            const auto read = scans > coding ? static_cast<std::uint16_t>(scans - coding) : std::uint16_t{0};
            const std::uint16_t steps = cycles < read ? cycles : read;
            frame.missing_before = steps ? static_cast<std::uint16_t>(steps - 1) : std::uint16_t{0};
            losses_.boards[frame.address].missing += frame.missing_before;
        }
        board.has_cycle = true;
        board.cycle = frame.cycle;
        board.scan = frame.board_sequence;
    }

    /* Returns whether the board's CRC b is correct, without a second pass over the snapshot. After n bytes of the
     * snapshot, the registers of the frame's CRC (after header h) and of the board's CRC (after address a) differ by
     * the effect of n zero bytes on h ^ a. If b is correct, b is the inverted register of the board, so that the
     * frame's register, xored with b, is all ones and this effect; four zero bytes later it is the register of the
     * frame's CRC. */
    bool is_board_crc_correct(const Frame &frame)
    {
        constexpr std::uint32_t ONES_AND_FOUR_ZEROS = 0xDEBB20E3;
        const std::uint8_t *body = frame.payload - FRAME_HEADER_SIZE, *snapshot = frame.payload + TaxelHeader::size;
        const std::size_t size = frame.length - TaxelHeader::size; /* with the board's CRC */
        const std::uint32_t address_crc = crc32(frame.payload, 1);
        std::uint32_t frame_crc = 0, board_crc = 0;
        detail::load(snapshot + size, frame_crc);
        detail::load(snapshot + size - 4, board_crc);
        const detail::CrcZeros *zeros = get_zeros_table(size);
        if (!zeros) {
            return crc32(snapshot, size - 4, address_crc) == board_crc;
        }
        const std::uint32_t difference = crc32(body, FRAME_HEADER_SIZE + TaxelHeader::size) ^ address_crc;
        return (~frame_crc ^ ONES_AND_FOUR_ZEROS) == (*zeros)(difference);
    }

    /* Returns the table for this size of a snapshot, built at its first use; NULL after the first SIZES_MAX sizes. */
    const detail::CrcZeros *get_zeros_table(std::size_t size)
    {
        constexpr std::size_t SIZES_MAX = 8;
        for (const detail::CrcZeros &zeros : zeros_) {
            if (zeros.size() == size) {
                return &zeros;
            }
        }
        if (zeros_.size() == SIZES_MAX) {
            return nullptr;
        }
        zeros_.emplace_back(size);
        return &zeros_.back();
    }

    unsigned directions_;
    Deframer deframer_;
    Losses losses_;
    bool has_sequence_ = false;
    std::uint16_t next_sequence_ = 0, lost_before_unknown_ = 0;
    Board boards_[ADDRESSES];
    std::vector<detail::CrcZeros> zeros_;
    std::uint16_t counts_[TAXELS_MAX + detail::PADDING / 2];
};

} // namespace taxel

#endif
