/* The host at the simulated hub's UART: sends commands and stores the received frames. */
#include "fake_hub.h"

#include "codec/encoder.h"

/* Store a frame from the hub and count gaps in the frame sequence; handler of the deframer. */
static void on_frame(void *context, const struct taxel_frame *frame)
{
    struct fake_hub *fake = context;
    fake->sequence_gaps += frame->sequence != fake->next_sequence;
    fake->next_sequence = (uint16_t)(frame->sequence + 1u);
    if (fake->frame_count < FAKE_FRAMES) {
        struct fake_frame *stored = &fake->frames[fake->frame_count++];
        stored->type = frame->type;
        stored->sequence = frame->sequence;
        stored->length = frame->length;
        memcpy(stored->payload, frame->payload, frame->length);
    }
}

/* Initialise the simulated host, which decodes and stores the frames of the hub. */
void fake_host_init(struct fake_hub *fake)
{
    const struct taxel_deframer_config config = {
        .chunk = fake->chunk,
        .chunk_capacity = sizeof fake->chunk,
        .body = fake->body,
        .payload_max = TAXEL_PAYLOAD_MAX,
        .directions = TAXEL_DIRECTION_TO_HOST,
        .handler = on_frame,
        .context = fake,
    };
    taxel_deframer_init(&fake->deframer, &config);
}

/* Send one frame with `size` bytes of payload from the host to the hub. */
void fake_hub_send(struct fake_hub *fake, uint8_t type, const uint8_t *payload, size_t size)
{
    uint8_t bytes[256];
    struct taxel_encoder encoder;
    taxel_encoder_begin(&encoder, bytes, sizeof bytes, 0, type, 0, (uint16_t)size);
    taxel_encoder_put(&encoder, payload, size);
    fake_hub_receive(fake, bytes, taxel_encoder_end(&encoder));
}

/* Return the status of the reply to a command among the frames from index `from` on, or a negative number if there is
 * none; stores the data of the reply. */
static int status_of_reply(struct fake_hub *fake, size_t from, uint8_t tag, uint8_t command)
{
    for (size_t i = from; i < fake->frame_count; i++) {
        const struct fake_frame *frame = &fake->frames[i];
        if (frame->type == TAXEL_FRAME_TYPE_REPLY && frame->payload[0] == tag && frame->payload[1] == command) {
            fake->reply_size = frame->length - TAXEL_REPLY_HEADER_SIZE;
            memcpy(fake->reply, frame->payload + TAXEL_REPLY_HEADER_SIZE, fake->reply_size);
            return frame->payload[2];
        }
    }
    return -1;
}

/* Send a command to the hub and run until its reply arrives. Returns the status of the reply, or a negative
 * number after `timeout_us`. */
int fake_hub_command_within(struct fake_hub *fake, uint8_t command, const uint8_t *arguments, size_t size,
                            uint64_t timeout_us)
{
    uint8_t payload[TAXEL_COMMAND_HEADER_SIZE + TAXEL_HUB_COMMAND_PAYLOAD_MAX] = {++fake->tag, command};
    const size_t from = fake->frame_count;
    const uint64_t until = fake->now_us + timeout_us;
    memcpy(payload + TAXEL_COMMAND_HEADER_SIZE, arguments, size);
    fake_hub_send(fake, TAXEL_FRAME_TYPE_COMMAND, payload, TAXEL_COMMAND_HEADER_SIZE + size);
    int status = status_of_reply(fake, from, fake->tag, command);
    while (status < 0 && fake->now_us < until && fake_hub_step(fake, until)) {
        status = status_of_reply(fake, from, fake->tag, command);
    }
    return status;
}

/* Send a command to the hub and run until its reply arrives, at most 2 s. Returns the status of the reply, or a
 * negative number. */
int fake_hub_command(struct fake_hub *fake, uint8_t command, const uint8_t *arguments, size_t size)
{
    return fake_hub_command_within(fake, command, arguments ? arguments : (const uint8_t *)"", size, 2000000u);
}

/* Perform the handshake of the host with the hub. Returns whether the hub agreed on the present protocol version. */
bool fake_hub_handshake(struct fake_hub *fake)
{
    const uint8_t handshake[TAXEL_HOST_HANDSHAKE_SIZE] = {77, 1, TAXEL_PROTOCOL_VERSION};
    fake_hub_send(fake, TAXEL_FRAME_TYPE_HOST_HANDSHAKE, handshake, sizeof handshake);
    fake_hub_run(fake, 100);
    const struct fake_frame *answer = fake_hub_last(fake, TAXEL_FRAME_TYPE_HUB_HANDSHAKE);
    return answer && answer->payload[0] == 77 && answer->payload[3] == TAXEL_PROTOCOL_VERSION;
}

/* Return the number of stored frames of one type. */
size_t fake_hub_count(const struct fake_hub *fake, uint8_t type)
{
    size_t count = 0;
    for (size_t i = 0; i < fake->frame_count; i++) {
        count += fake->frames[i].type == type;
    }
    return count;
}

/* Return the last stored frame of one type, or NULL. */
const struct fake_frame *fake_hub_last(const struct fake_hub *fake, uint8_t type)
{
    for (size_t i = fake->frame_count; i-- > 0;) {
        if (fake->frames[i].type == type) {
            return &fake->frames[i];
        }
    }
    return NULL;
}

/* Return the number of stored frames of one type for the board with this address. */
size_t fake_hub_count_of(const struct fake_hub *fake, uint8_t type, uint8_t address)
{
    size_t count = 0;
    for (size_t i = 0; i < fake->frame_count; i++) {
        count += fake->frames[i].type == type && fake->frames[i].payload[0] == address;
    }
    return count;
}

/* Return the number of stored BOARD_FAULT frames with this fault for the board with this address. */
size_t fake_hub_count_faults(const struct fake_hub *fake, uint8_t address, uint8_t fault)
{
    size_t count = 0;
    for (size_t i = 0; i < fake->frame_count; i++) {
        const struct fake_frame *frame = &fake->frames[i];
        count +=
            frame->type == TAXEL_FRAME_TYPE_BOARD_FAULT && frame->payload[0] == address && frame->payload[1] == fault;
    }
    return count;
}

/* Discard all stored frames. */
void fake_hub_forget_frames(struct fake_hub *fake)
{
    fake->frame_count = 0;
}

/* Return the entry of the hub's board table for this address, or NULL. */
struct taxel_hub_slot *fake_hub_slot(struct fake_hub *fake, uint8_t address)
{
    const uint8_t slot = taxel_hub_slot_of(&fake->hub, address);
    return slot == TAXEL_NO_SLOT ? NULL : &fake->slots[slot];
}

/* Return whether the number of polls of every board equals the sum of its outcome counters plus a poll in progress
 * (modulo 256, the range of `polls`). */
bool fake_hub_accounts_balance(const struct fake_hub *fake)
{
    for (uint8_t i = 0; i < fake->hub.slot_count; i++) {
        const struct taxel_hub_slot *slot = &fake->slots[i];
        const struct taxel_job *job = &fake->hub.job;
        const uint32_t ended = slot->forwarded + slot->repeated + slot->nacks + slot->timeouts + slot->crc_errors +
                               slot->bus_errors + slot->dropped;
        const struct taxel_unframed *unframed = &fake->hub.unframed;
        const bool in_flight = slot->retry_pending ||
                               (job->slot == i && (job->kind == TAXEL_JOB_POLL || job->kind == TAXEL_JOB_PROBE_SLOT)) ||
                               (unframed->size && unframed->slot == i && unframed->type != TAXEL_FRAME_TYPE_BOARD_INFO);
        if (slot->polls != (uint8_t)(ended + in_flight)) {
            return false;
        }
    }
    return true;
}

/* Start the hub, let it find its boards, perform the handshake and start the stream. Returns whether all
 * succeeded. */
bool fake_hub_start(struct fake_hub *fake)
{
    fake_hub_boot(fake);
    fake_hub_run(fake, 200000);
    const bool started = fake_hub_handshake(fake) && fake_hub_command(fake, TAXEL_COMMAND_START, NULL, 0) == 0;
    fake_hub_forget_frames(fake);
    return started;
}
