/* Incoming UART bytes. They stay in the receive ring until a frame is found in them or they are discarded; only the
 * payload of an accepted frame is copied. protocol/SPEC.md defines the receiver; codec/deframer.c implements it for
 * streams of any length. */
#include <stdatomic.h>

#include "codec/crc32.h"
#include "hub/internal.h"

#define LONGEST (TAXEL_FRAME_HEADER_SIZE + TAXEL_HUB_COMMAND_PAYLOAD_MAX + TAXEL_FRAME_CRC_SIZE)
#define LONGEST_ENCODED (LONGEST + 1u) /* without delimiters */
#define CRC_OF_WHOLE_BODY 0x2144DF1Cu  /* CRC-32 of any bytes followed by their own CRC-32 */
#define NO_BYTE (-1)
#define WAIT (-1)

/* Change RTS, which makes the host pause (`is_hold`) or continue. The interrupt calls this function to hold, the main
 * loop to release. The two thresholds of free space are so far apart that the calls do not interleave. */
static void hold(struct taxel_hub *hub, bool is_hold)
{
    const struct taxel_hub_hal *hal = taxel_hub_hal_of(hub);
    if (hal->uart_hold && hub->inbox.is_holding != is_hold) {
        hub->inbox.is_holding = is_hold;
        hal->uart_hold(hal->context, is_hold);
    }
}

/* Return the number of free bytes in the receive ring, which keeps one of its 256 bytes empty. */
static uint8_t free_space(const struct taxel_inbox *inbox)
{
    return (uint8_t)(inbox->tail - inbox->head - 1u); /* the ring has 256 bytes: indices wrap by themselves */
}

/* Store a byte from the host in the receive ring; called from the UART interrupt. RTS stops the host when the ring is
 * nearly full; a byte without space is counted as an overrun. */
void taxel_hub_on_uart_byte(struct taxel_hub *hub, uint8_t byte)
{
    struct taxel_inbox *inbox = &hub->inbox;
    if (free_space(inbox) == 0) {
        inbox->overruns++;
        return;
    }
    inbox->ring[inbox->head] = byte;
    atomic_signal_fence(memory_order_release);
    inbox->head = (uint8_t)(inbox->head + 1u);
    if (free_space(inbox) <= TAXEL_HUB_HOLD_SPACE) {
        hold(hub, true);
    }
}

/* A reader of a stuffed, whitened body in the receive ring. A chunk is the bytes between two delimiters. */
struct body {
    const uint8_t *ring;
    uint8_t at;        /* index of the next byte */
    uint8_t ahead;     /* remaining bytes of the chunk */
    uint8_t remaining; /* remaining bytes of the COBS block */
    uint8_t whitening; /* element of the whitening sequence for the next byte */
};

/* Read the code byte of the next COBS block (its length plus 1). Returns false if the block does not fit in the bytes
 * up to the delimiter. */
static bool open_block(struct body *body)
{
    const uint8_t code = body->ring[body->at];
    if (body->ahead == 0 || code > body->ahead) {
        return false; /* the block reaches past the end of the chunk */
    }
    body->at = (uint8_t)(body->at + 1u);
    body->ahead = (uint8_t)(body->ahead - 1u);
    body->remaining = (uint8_t)(code - 1u);
    return true;
}

/* Return a reader of the frame body that begins at the oldest byte of the receive ring and has `size` bytes before
 * unstuffing. */
static struct body body_at_tail(const struct taxel_inbox *inbox, uint8_t size)
{
    return (struct body){
        .ring = inbox->ring, .at = inbox->tail, .ahead = size, .whitening = (uint8_t)TAXEL_WHITENING_SEED};
}

/* Return the next byte of a frame body in the receive ring, unstuffed and unwhitened; NO_BYTE if the byte's COBS block
 * reaches past the next delimiter. The caller has opened the first block. Every accepted body is shorter than a full
 * block of 254 bytes, so a zero follows each block but the last. */
static int next_byte(struct body *body)
{
    uint8_t byte = 0;
    if (body->remaining) {
        byte = body->ring[body->at];
        body->at = (uint8_t)(body->at + 1u);
        body->ahead = (uint8_t)(body->ahead - 1u);
        body->remaining = (uint8_t)(body->remaining - 1u);
    } else if (!open_block(body)) {
        return NO_BYTE;
    }
    byte ^= body->whitening;
    body->whitening = (uint8_t)(TAXEL_WHITENING_FACTOR * body->whitening + TAXEL_WHITENING_INCREMENT);
    return byte;
}

/* Return whether a frame header contains a type that the host may send and a payload length that this type allows. */
static bool is_header_valid(const uint8_t *header)
{
    const uint16_t length = taxel_get_u16(header + 3);
    if (header[0] == TAXEL_FRAME_TYPE_HOST_HANDSHAKE) {
        return length == TAXEL_HOST_HANDSHAKE_SIZE;
    }
    if (header[0] == TAXEL_FRAME_TYPE_ACKNOWLEDGE) {
        return length && length <= TAXEL_ACKNOWLEDGE_MAX * TAXEL_ACKNOWLEDGEMENT_SIZE &&
               length % TAXEL_ACKNOWLEDGEMENT_SIZE == 0;
    }
    return header[0] == TAXEL_FRAME_TYPE_COMMAND && length >= TAXEL_COMMAND_HEADER_SIZE &&
           length <= TAXEL_HUB_COMMAND_PAYLOAD_MAX;
}

/* Check whether a valid frame begins at the oldest byte of the receive ring; `size`: bytes before the next delimiter.
 * Returns the length of the frame in the ring and, in `header`, its unstuffed header; 0 if no valid frame begins
 * there. */
TAXEL_OWN_FRAME static uint8_t find_frame(const struct taxel_inbox *inbox, uint8_t size, uint8_t *header)
{
    struct body body = body_at_tail(inbox, size);
    uint32_t crc = 0;
    size_t expected = TAXEL_FRAME_HEADER_SIZE;
    if (!open_block(&body)) {
        return 0;
    }
    for (size_t i = 0; i < expected; i++) {
        const int next = next_byte(&body);
        const uint8_t byte = (uint8_t)next;
        if (next == NO_BYTE) {
            return 0;
        }
        crc = taxel_crc32(crc, &byte, 1);
        if (i < TAXEL_FRAME_HEADER_SIZE) {
            header[i] = byte;
        }
        if (i == TAXEL_FRAME_HEADER_SIZE - 1u) {
            if (!is_header_valid(header)) {
                return 0;
            }
            expected += taxel_get_u16(header + 3) + TAXEL_FRAME_CRC_SIZE;
        }
    }
    return body.remaining == 0 && crc == CRC_OF_WHOLE_BODY ? (uint8_t)(size - body.ahead) : 0;
}

/* Copy the payload of the valid frame at the oldest byte of the receive ring to the payload buffer, and remove the
 * frame from the ring. Acknowledgements are handled here, one by one, because the payload buffer may still contain the
 * command in progress. `size`: length of the frame in the ring; `header`: its header. */
TAXEL_OWN_FRAME static void take_payload(struct taxel_hub *hub, uint8_t size, const uint8_t *header)
{
    struct taxel_inbox *inbox = &hub->inbox;
    struct body body = body_at_tail(inbox, size);
    const size_t length = taxel_get_u16(header + 3);
    uint8_t acknowledgement[TAXEL_ACKNOWLEDGEMENT_SIZE];
    (void)open_block(&body);
    for (size_t i = 0; i < TAXEL_FRAME_HEADER_SIZE; i++) {
        (void)next_byte(&body);
    }
    for (size_t i = 0, n = 0; i < length; i++) {
        const uint8_t byte = (uint8_t)next_byte(&body);
        if (header[0] != TAXEL_FRAME_TYPE_ACKNOWLEDGE) {
            inbox->payload[i] = byte;
            continue;
        }
        acknowledgement[n++] = byte;
        if (n == sizeof acknowledgement) {
            n = 0;
            taxel_hub_handle_acknowledgement(hub, acknowledgement[0],
                                             taxel_get_u16(acknowledgement + TAXEL_ACKNOWLEDGEMENT_OFFSET_KEY_FRAME));
        }
    }
    inbox->tail = (uint8_t)(inbox->tail + size);
}

/* Execute the valid frame at the oldest byte of the receive ring; `header`: header of the frame. Returns false, and
 * leaves the frame in the ring, if it is a handshake or command that must wait for the command in progress or for space
 * for its reply. */
static bool take_frame(struct taxel_hub *hub, uint8_t size, const uint8_t *header)
{
    const bool is_acknowledge = header[0] == TAXEL_FRAME_TYPE_ACKNOWLEDGE;
    if (!is_acknowledge && (hub->command.active || !taxel_hub_has_space_for_reply(hub))) {
        return false;
    }
    take_payload(hub, size, header);
    if (header[0] == TAXEL_FRAME_TYPE_HOST_HANDSHAKE) {
        taxel_hub_handle_handshake(hub);
    } else if (!is_acknowledge) {
        taxel_hub_handle_command(hub, taxel_get_u16(header + 3));
    }
    return true;
}

/* Return the number of bytes before the next delimiter in the receive ring, 0 if a delimiter is next, or WAIT if no
 * delimiter has arrived. Without a delimiter, the number of bytes is returned once it is larger than any frame. The
 * head is read only once, because the interrupt changes it. */
static int chunk_at_tail(struct taxel_inbox *inbox)
{
    const uint8_t head = inbox->head;
    atomic_signal_fence(memory_order_acquire);
    while (inbox->search_position != head && inbox->ring[inbox->search_position] != 0) {
        inbox->search_position = (uint8_t)(inbox->search_position + 1u);
    }
    const uint8_t size = (uint8_t)(inbox->search_position - inbox->tail);
    return inbox->search_position != head || size > LONGEST_ENCODED ? size : WAIT;
}

/* Discard the oldest byte of the receive ring. */
static void skip_byte(struct taxel_inbox *inbox)
{
    if (inbox->search_position == inbox->tail) {
        inbox->search_position = (uint8_t)(inbox->search_position + 1u);
    }
    inbox->tail = (uint8_t)(inbox->tail + 1u);
}

/* Initialise the receive side: lower RTS, so that the host can send. */
void taxel_hub_inbox_init(struct taxel_hub *hub)
{
    const struct taxel_hub_hal *hal = taxel_hub_hal_of(hub);
    if (hal->uart_hold) {
        hal->uart_hold(hal->context, false); /* the hub may have restarted while RTS was raised */
    }
}

/* Answer a command whose transfers have ended, then take complete frames out of the receive ring until one must wait
 * for the command in progress. Lets the host send again when enough space is free. Called from the main loop. */
void taxel_hub_read_inbox(struct taxel_hub *hub)
{
    struct taxel_inbox *inbox = &hub->inbox;
    if (hub->command.active) {
        taxel_hub_end_finished_command(hub);
    }
    for (;;) {
        uint8_t header[TAXEL_FRAME_HEADER_SIZE];
        const int size = chunk_at_tail(inbox);
        const uint8_t used = size > 0 ? find_frame(inbox, (uint8_t)size, header) : 0;
        if (size == WAIT || (used && !take_frame(hub, used, header))) {
            break;
        }
        if (!used) {
            skip_byte(inbox); /* a byte at which no frame begins, or a delimiter */
        }
    }
    if (free_space(inbox) >= TAXEL_HUB_RELEASE_SPACE) {
        hold(hub, false);
    }
}
