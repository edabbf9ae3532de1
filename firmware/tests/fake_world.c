#define _GNU_SOURCE
#include "fake_world.h"

#include <stdlib.h>

#include "codec/crc32.h"
#include "codec/encoder.h"
#include "emulator/physics/layer.h"

#define STEP (2u * VTIME_MS)
#define RECORD_HEAD 12u

/* Return whether the CRC of the board in the payload of a TAXELS frame is correct. */
static bool board_crc_is_right(const uint8_t *payload, size_t length)
{
    const uint8_t *snapshot = payload + TAXEL_TAXEL_HEADER_SIZE;
    const size_t size = length - TAXEL_TAXEL_HEADER_SIZE;
    return taxel_crc32(taxel_crc32(0, payload, 1), snapshot, size - 4u) == taxel_get_u32(snapshot + size - 4u);
}

/* Evaluate a frame that the emulated hub has sent, and count gaps in the frame sequence; handler of the deframer. */
static void on_frame(void *context, const struct taxel_frame *frame)
{
    struct fake_world *fake = context;
    fake->sequence_gaps += frame->sequence != fake->next_sequence;
    fake->next_sequence = (uint16_t)(frame->sequence + 1u);
    if (frame->type == TAXEL_FRAME_TYPE_HUB_HANDSHAKE && frame->payload[0] == 0) {
        fake->restarts++;
    }
    if (frame->type == TAXEL_FRAME_TYPE_REPLY) {
        fake->replies++;
        fake->reply_tag = frame->payload[TAXEL_REPLY_HEADER_OFFSET_TAG];
        fake->reply_status = frame->payload[TAXEL_REPLY_HEADER_OFFSET_STATUS];
    }
    if (frame->type == TAXEL_FRAME_TYPE_TAXELS) {
        const uint8_t *counts = frame->payload + TAXEL_TAXEL_HEADER_SIZE + TAXEL_SNAPSHOT_HEADER_SIZE;
        fake->taxel_frames++;
        fake->frames_of[frame->payload[0]]++;
        fake->bad_board_crcs += !board_crc_is_right(frame->payload, frame->length);
        for (size_t i = 0; i < frame->payload[1]; i++) {
            fake->counts_of[frame->payload[0]][i] = taxel_get_u16(counts + 2u * i);
        }
    }
}

/* Describe an emulated world with `boards` boards of `taxels` taxels each, without faults and effects. */
void fake_world_describe(struct fake_world *fake, size_t boards, uint16_t taxels)
{
    memset(fake, 0, sizeof *fake);
    struct world_description *world = &fake->description;
    world->seed = 1;
    world->scl_hz = 400000.0;
    world->baud = 1000000.0;
    world->usb_latency_ms = 1.0;
    world->usb_latency_down_ms = 1.0;
    world->noise_counts = 3.0;
    world->scan = (struct taxel_scan_settings){160, 40, 1, 16, 96};
    world->layer_thickness = 0.001;
    world->board_count = boards;
    for (size_t i = 0; i < boards; i++) {
        struct board_description *board = &world->boards[i];
        board->address = (uint8_t)(0x20u + i);
        board->kind = 1;
        board->rows = 16;
        board->columns = 16;
        board->taxel_count = taxels;
        for (unsigned crossing = 0; crossing < taxels; crossing++) {
            board->crossing_map[crossing >> 3] |= (uint8_t)(1u << (crossing & 7u));
        }
        board->unique_id[0] = board->address;
        board->boot_ms = 5.0;
        board->bracket_offset = frame_identity;
    }
}

/* Add a fault with one value to the description of the world. */
void fake_world_fault(struct fake_world *fake, double time_s, enum fault_kind kind, uint8_t address, double value)
{
    fake_world_fault_at(fake, time_s, kind, address, value, 0.0);
}

/* Add a fault with two values (for faults of a byte: its position and the parameter) to the description of the
 * world. */
void fake_world_fault_at(struct fake_world *fake, double time_s, enum fault_kind kind, uint8_t address, double position,
                         double second)
{
    fake->description.faults[fake->description.fault_count++] = (struct fault_description){
        .time_s = time_s, .kind = kind, .address = address, .value = position, .second_value = second};
}

/* Create the described world, with a stimulus from the file descriptor (-1: none). Returns 0, or -1 on an
 * error. */
int fake_world_open(struct fake_world *fake, int stimulus_fd)
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
    static bool has_tables; /* their computation takes most of the time of a short test */
    if (!has_tables) {
        layer_init();
        has_tables = true;
    }
    taxel_deframer_init(&fake->deframer, &config);
    fake->endpoint.kind = ENDPOINT_CAPTURE;
    fake->endpoint.fd = -1;
    fake->endpoint.capture = open_memstream(&fake->captured, &fake->captured_size);
    fake->script.next = VTIME_NEVER;
    if (stimulus_open(&fake->stimulus, stimulus_fd, "test", world_taxel_count(&fake->description), false)) {
        return -1;
    }
    return world_init(&fake->world, &fake->description, &fake->stimulus, &fake->endpoint, &fake->script);
}

/* Free the world, its stimulus and its endpoint. */
void fake_world_close(struct fake_world *fake)
{
    world_free(&fake->world);
    stimulus_close(&fake->stimulus);
    endpoint_close(&fake->endpoint);
    free(fake->captured);
}

/* Decode the bytes that the emulated hub has sent since the last call, and add them to the CRC of the stream. */
static void take_in(struct fake_world *fake)
{
    fflush(fake->endpoint.capture);
    while (fake->captured_read + RECORD_HEAD <= fake->captured_size) {
        const uint8_t *record = (const uint8_t *)fake->captured + fake->captured_read;
        const size_t size = taxel_get_u32(record + 8);
        taxel_deframer_push(&fake->deframer, record + RECORD_HEAD, size);
        fake->stream_crc = taxel_crc32(fake->stream_crc, record + RECORD_HEAD, size);
        fake->stream_bytes += size;
        fake->captured_read += RECORD_HEAD + size;
    }
}

/* Run the world for a virtual time in seconds, in steps of `step` picoseconds. Returns 0, or -1 on an error. */
int fake_world_run_in_steps(struct fake_world *fake, double seconds, vtime step)
{
    const vtime end = fake->world.now + (vtime)(seconds * (double)VTIME_SECOND);
    int result = 0;
    while (!result && fake->world.now < end) {
        result = world_run(&fake->world, vtime_min(end, fake->world.now + step));
        take_in(fake);
    }
    return result;
}

/* Run the world for a virtual time in seconds. Returns 0, or -1 on an error. */
int fake_world_run(struct fake_world *fake, double seconds)
{
    return fake_world_run_in_steps(fake, seconds, STEP);
}

/* Send one frame from the host to the emulated hub. */
static void host_sends(struct fake_world *fake, uint8_t type, const uint8_t *payload, size_t size)
{
    uint8_t bytes[256];
    struct taxel_encoder encoder;
    taxel_encoder_begin(&encoder, bytes, sizeof bytes, 0, type, 0, (uint16_t)size);
    taxel_encoder_put(&encoder, payload, size);
    const size_t encoded = taxel_encoder_end(&encoder);
    (void)uart_send_from_host(&fake->world.uart, bytes, encoded, fake->world.now);
}

/* Send a command with `size` bytes of arguments from the host to the emulated hub, without waiting for the
 * reply. */
void fake_world_command(struct fake_world *fake, uint8_t command, const uint8_t *arguments, size_t size)
{
    uint8_t payload[TAXEL_COMMAND_HEADER_SIZE + TAXEL_HUB_COMMAND_PAYLOAD_MAX] = {++fake->tag, command};
    if (size) {
        memcpy(payload + TAXEL_COMMAND_HEADER_SIZE, arguments, size);
    }
    host_sends(fake, TAXEL_FRAME_TYPE_COMMAND, payload, TAXEL_COMMAND_HEADER_SIZE + size);
}

/* Let the emulated hub find its boards, perform the handshake and start the stream. Returns whether the hub
 * streams. */
bool fake_world_start(struct fake_world *fake)
{
    const uint8_t handshake[TAXEL_HOST_HANDSHAKE_SIZE] = {9, 1, TAXEL_PROTOCOL_VERSION};
    if (fake_world_run(fake, 0.5)) {
        return false;
    }
    host_sends(fake, TAXEL_FRAME_TYPE_HOST_HANDSHAKE, handshake, sizeof handshake);
    fake_world_command(fake, TAXEL_COMMAND_START, NULL, 0);
    return fake_world_run(fake, 0.02) == 0 && fake->world.hub.hub.streaming;
}

/* Return the entry of the emulated hub's board table for this address, or NULL. */
struct taxel_hub_slot *fake_world_slot(struct fake_world *fake, uint8_t address)
{
    struct hub_node *node = &fake->world.hub;
    for (uint8_t i = 0; i < node->hub.slot_count; i++) {
        if (node->slots[i].address == address) {
            return &node->slots[i];
        }
    }
    return NULL;
}

/* Return whether the polls of every board equal the sum of its outcomes, no frame or byte was lost or damaged, and the
 * host received what the hub forwarded. After a restart of the hub, its counters begin at 0, so the number of frames is
 * not compared. */
bool fake_world_adds_up(const struct fake_world *fake)
{
    const struct hub_node *node = &fake->world.hub;
    uint64_t forwarded = 0;
    for (uint8_t i = 0; i < node->hub.slot_count; i++) {
        const struct taxel_hub_slot *slot = &node->slots[i];
        const uint32_t ended = slot->forwarded + slot->repeated + slot->nacks + slot->timeouts + slot->crc_errors +
                               slot->bus_errors + slot->dropped;
        const struct taxel_job *job = &node->hub.job;
        const struct taxel_unframed *unframed = &node->hub.unframed;
        const bool in_flight = slot->retry_pending ||
                               (job->slot == i && (job->kind == TAXEL_JOB_POLL || job->kind == TAXEL_JOB_PROBE_SLOT)) ||
                               (unframed->size && unframed->slot == i && unframed->type != TAXEL_FRAME_TYPE_BOARD_INFO);
        forwarded += slot->forwarded;
        if (slot->polls != (uint8_t)(ended + in_flight)) {
            return false;
        }
    }
    /* What the hub sent and the host has not yet got is in the transmit ring and in the adapter. */
    const bool all_arrived = fake->world.uart.packet_fill == 0 && taxel_hub_uart_pending(&node->hub) == 0;
    return fake->bad_board_crcs == 0 && fake->sequence_gaps == 0 && fake->deframer.discarded_bytes == 0 &&
           (fake->restarts > 1 || fake->taxel_frames <= forwarded) &&
           (fake->restarts > 1 || !all_arrived || fake->taxel_frames == forwarded);
}
