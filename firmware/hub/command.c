/* Frames from the host: handshake, commands and acknowledgements. Only one command is in progress at a time; its
 * payload stays in the inbox until the command is answered. */
#include "hub/internal.h"

#define VERSION_OF_COMPACT 2u
#define RESTART_TIMEOUT_US 500000u /* limit for sending the reply to REBOOT, for a UART without a reader */

/* Queue a HUB_HANDSHAKE frame: identity, firmware version and uptime of the hub. `version`: the negotiated protocol
 * version, 0 if none; `tag`: copied from the host's handshake, 0 for the unrequested frame after a reset. */
void taxel_hub_send_handshake(struct taxel_hub *hub, uint8_t tag, uint8_t version)
{
    const struct taxel_hub_config *config = taxel_hub_config_of(hub);
    uint8_t bytes[TAXEL_HUB_HANDSHAKE_SIZE];
    struct taxel_hub_handshake handshake = {
        .tag = tag,
        .version_min = TAXEL_PROTOCOL_VERSION_MIN,
        .version_max = TAXEL_PROTOCOL_VERSION,
        .version_chosen = version,
        .reset_cause = hub->reset_cause,
        .firmware_major = config->firmware_version[0],
        .firmware_minor = config->firmware_version[1],
        .firmware_patch = config->firmware_version[2],
        .uptime_us = taxel_hub_clock(hub),
    };
    memcpy(handshake.unique_id, config->unique_id, sizeof handshake.unique_id);
    taxel_hub_handshake_pack(&handshake, bytes);
    (void)taxel_hub_send(hub, TAXEL_FRAME_TYPE_HUB_HANDSHAKE, bytes, sizeof bytes, NULL, 0);
}

/* End the command in progress: queue its REPLY frame with `status` (enum taxel_reply_status) and `size` bytes of data.
 * A status other than OK is counted as a rejected command. */
void taxel_hub_reply(struct taxel_hub *hub, uint8_t status, const uint8_t *data, size_t size)
{
    uint8_t bytes[TAXEL_REPLY_HEADER_SIZE];
    const struct taxel_reply_header header = {
        .tag = hub->command.tag,
        .command = hub->command.command,
        .status = status,
    };
    taxel_reply_header_pack(&header, bytes);
    (void)taxel_hub_send(hub, TAXEL_FRAME_TYPE_REPLY, bytes, sizeof bytes, data, size);
    hub->command.active = false;
    if (status != TAXEL_REPLY_STATUS_OK) {
        hub->inbox.commands_rejected++;
    }
}

/* Answer the HOST_HANDSHAKE frame in the inbox. The highest protocol version common to both sides is used; 0 means that
 * there is none, and commands are then rejected. Compact snapshots end if the version does not define them. */
void taxel_hub_handle_handshake(struct taxel_hub *hub)
{
    struct taxel_host_handshake handshake;
    taxel_host_handshake_unpack(&handshake, hub->inbox.payload);
    const uint8_t highest =
        handshake.version_max < TAXEL_PROTOCOL_VERSION ? handshake.version_max : (uint8_t)TAXEL_PROTOCOL_VERSION;
    const bool agreed = highest >= TAXEL_PROTOCOL_VERSION_MIN && highest >= handshake.version_min;
    hub->version = agreed ? highest : 0;
    taxel_hub_set_compact(hub, hub->use_compact && hub->version >= VERSION_OF_COMPACT);
    taxel_hub_send_handshake(hub, handshake.tag, hub->version);
}

/* Queue a REPLY frame with the status OK and no data for the command in progress. */
static void reply_ok(struct taxel_hub *hub)
{
    taxel_hub_reply(hub, TAXEL_REPLY_STATUS_OK, NULL, 0);
}

/* Execute the command SET_RATE: set the period of the poll cycle in microseconds (0: as fast as possible), and
 * reply. */
static void set_rate(struct taxel_hub *hub, const uint8_t *bytes)
{
    struct taxel_set_rate_arguments arguments;
    taxel_set_rate_arguments_unpack(&arguments, bytes);
    hub->cycle.period_us = arguments.period_us;
    reply_ok(hub);
}

/* Execute the command I2C_TRANSFER: store the requested transfer for the scheduler, which starts it when the bus is
 * free. The reply follows at the end of the transfer, or at once (BAD_ARGUMENTS) for an invalid address or read length.
 * `bytes`, `size`: arguments of the command. */
static void request_transfer(struct taxel_hub *hub, const uint8_t *bytes, size_t size)
{
    struct taxel_command_in_progress *command = &hub->command;
    struct taxel_transfer_arguments arguments;
    taxel_transfer_arguments_unpack(&arguments, bytes);
    if (arguments.address < TAXEL_ADDRESS_MIN || arguments.address > TAXEL_ADDRESS_MAX ||
        arguments.read_length > TAXEL_TRANSFER_MAX || arguments.read_length > taxel_hub_read_max(hub)) {
        taxel_hub_reply(hub, TAXEL_REPLY_STATUS_BAD_ARGUMENTS, NULL, 0);
        return;
    }
    command->address = arguments.address;
    command->transfer_read = arguments.read_length;
    command->transfer_size = (uint8_t)(size - TAXEL_TRANSFER_ARGUMENTS_SIZE);
}

/* Execute the command START: begin to poll the boards, and reply. The optional flags byte (protocol version 2) requests
 * compact snapshots; undefined flags are rejected. */
static void execute_start(struct taxel_hub *hub, const uint8_t *bytes, size_t size)
{
    const uint8_t flags = size ? bytes[TAXEL_START_ARGUMENTS_OFFSET_FLAGS] : 0;
    if (flags & ~TAXEL_START_FLAG_COMPACT || (size && hub->version < VERSION_OF_COMPACT)) {
        taxel_hub_reply(hub, TAXEL_REPLY_STATUS_BAD_ARGUMENTS, NULL, 0);
        return;
    }
    taxel_hub_set_compact(hub, flags & TAXEL_START_FLAG_COMPACT);
    taxel_hub_start_streaming(hub);
    reply_ok(hub);
}

/* Store an entry of an ACKNOWLEDGE frame, which is written to the board before its next poll: the host has decoded the
 * board's key frame `key_frame_id`, or, with the flag TAXEL_ACKNOWLEDGE_FORGET in `address`, has no key frame of the
 * board. Entries for unknown boards, and all entries while the hub uses no compact snapshots, are ignored. */
void taxel_hub_handle_acknowledgement(struct taxel_hub *hub, uint8_t address, uint16_t key_frame_id)
{
    const uint8_t slot = taxel_hub_slot_of(hub, address & (uint8_t)~TAXEL_ACKNOWLEDGE_FORGET);
    if (slot == TAXEL_NO_SLOT || !hub->use_compact) {
        return;
    }
    struct taxel_hub_slot *board = taxel_hub_slot_at(hub, slot);
    board->forget_pending = address & TAXEL_ACKNOWLEDGE_FORGET;
    board->acknowledge_pending = !board->forget_pending;
    board->key_frame_id = key_frame_id;
}

/* Return whether a command with this address argument applies to `board`; address 0 selects every board. */
static bool is_selected(uint8_t address, const struct taxel_hub_slot *board)
{
    return address == 0 || board->address == address;
}

/* Execute the command SET_SCAN_SETTINGS: store the settings for the selected boards (address 0: all) that are
 * streaming; the scheduler writes them. The reply follows when the settings have been read back from all of these
 * boards, or at once (UNKNOWN_BOARD) if no selected board is streaming. */
static void set_scan_settings(struct taxel_hub *hub, const uint8_t *bytes, size_t size)
{
    hub->command.address = bytes[TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_OFFSET_ADDRESS];
    bool any = false;
    for (uint8_t i = 0; i < hub->slot_count; i++) {
        struct taxel_hub_slot *board = taxel_hub_slot_at(hub, i);
        if (!is_selected(hub->command.address, board)) {
            continue;
        }
        board->settings_rejected = false;
        if (board->state == TAXEL_BOARD_STATE_STREAMING) {
            taxel_scan_settings_unpack(&board->settings, bytes + TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_OFFSET_ADDRESS + 1u);
            board->front_end = size == TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_SIZE
                                   ? bytes[TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_OFFSET_FRONT_END]
                                   : (uint8_t)TAXEL_FRONT_END_CAPSENSE;
            board->has_settings = true;
            board->settings_dirty = true;
            any = true;
        }
    }
    if (!any) {
        taxel_hub_reply(hub, TAXEL_REPLY_STATUS_UNKNOWN_BOARD, NULL, 0);
    }
}

/* Execute the command GET_BOARD_INFO: request that the scheduler reads the identity of the selected boards (address 0:
 * all) and forwards it as BOARD_INFO frames. The reply follows after the last of them, or at once (UNKNOWN_BOARD) if
 * the single selected board is not streaming. */
static void get_board_info(struct taxel_hub *hub, const uint8_t *bytes)
{
    bool any = false;
    hub->command.address = bytes[0];
    for (uint8_t i = 0; i < hub->slot_count; i++) {
        struct taxel_hub_slot *board = taxel_hub_slot_at(hub, i);
        if (is_selected(hub->command.address, board) && board->state == TAXEL_BOARD_STATE_STREAMING) {
            board->info_requested = true;
            any = true;
        }
    }
    if (!any && hub->command.address != 0) {
        taxel_hub_reply(hub, TAXEL_REPLY_STATUS_UNKNOWN_BOARD, NULL, 0);
    }
}

/* Queue the reply to SET_SCAN_SETTINGS or GET_BOARD_INFO, which are executed within the poll cycle, once all selected
 * boards are done. Does nothing for other commands. */
void taxel_hub_end_finished_command(struct taxel_hub *hub)
{
    bool rejected = false;
    if (hub->command.command != TAXEL_COMMAND_SET_SCAN_SETTINGS &&
        hub->command.command != TAXEL_COMMAND_GET_BOARD_INFO) {
        return;
    }
    for (uint8_t i = 0; i < hub->slot_count; i++) {
        const struct taxel_hub_slot *board = taxel_hub_slot_at(hub, i);
        if (is_selected(hub->command.address, board)) {
            if (board->state == TAXEL_BOARD_STATE_STREAMING && (board->settings_dirty || board->info_requested)) {
                return;
            }
            rejected = rejected || board->settings_rejected;
        }
    }
    const bool settings = hub->command.command == TAXEL_COMMAND_SET_SCAN_SETTINGS;
    taxel_hub_reply(hub, settings && rejected ? TAXEL_REPLY_STATUS_REJECTED_BY_BOARD : TAXEL_REPLY_STATUS_OK, NULL, 0);
}

/* Execute the command GET_TIME: reply with the clock of the hub in microseconds, 64 bits. */
TAXEL_OWN_FRAME static void get_time(struct taxel_hub *hub)
{
    uint8_t bytes[TAXEL_GET_TIME_REPLY_SIZE];
    const struct taxel_get_time_reply reply = {.hub_time_us = taxel_hub_clock(hub)};
    taxel_get_time_reply_pack(&reply, bytes);
    taxel_hub_reply(hub, TAXEL_REPLY_STATUS_OK, bytes, sizeof bytes);
}

/* Execute the command GET_FAULT: reply with the fault record of the hub, or without data if the hub keeps none. */
static void get_fault(struct taxel_hub *hub)
{
    const uint8_t *record = taxel_hub_config_of(hub)->fault_record;
    taxel_hub_reply(hub, TAXEL_REPLY_STATUS_OK, record, record ? TAXEL_FAULT_RECORD_SIZE : 0);
}

/* Shortest and longest arguments of each command, in bytes. */
struct argument_rule {
    uint8_t command;
    uint8_t minimum;
    uint8_t maximum;
};

static const struct argument_rule argument_rules[] = {
    {TAXEL_COMMAND_START, 0, TAXEL_START_ARGUMENTS_SIZE},
    {TAXEL_COMMAND_STOP, 0, 0},
    {TAXEL_COMMAND_SET_RATE, TAXEL_SET_RATE_ARGUMENTS_SIZE, TAXEL_SET_RATE_ARGUMENTS_SIZE},
    {TAXEL_COMMAND_SCAN_BUS, 0, 0},
    {TAXEL_COMMAND_I2C_TRANSFER, TAXEL_TRANSFER_ARGUMENTS_SIZE, TAXEL_TRANSFER_ARGUMENTS_SIZE + TAXEL_TRANSFER_MAX},
    {TAXEL_COMMAND_SET_SCAN_SETTINGS, TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_SIZE - 1u,
     TAXEL_SET_SCAN_SETTINGS_ARGUMENTS_SIZE}, /* the front end may be missing */
    {TAXEL_COMMAND_REBOOT, 0, 0},
    {TAXEL_COMMAND_GET_STATUS, 0, 0},
    {TAXEL_COMMAND_GET_BOARD_INFO, TAXEL_GET_BOARD_INFO_ARGUMENTS_SIZE, TAXEL_GET_BOARD_INFO_ARGUMENTS_SIZE},
    {TAXEL_COMMAND_GET_TIME, 0, 0},
    {TAXEL_COMMAND_ENTER_BOOTLOADER, TAXEL_ENTER_BOOTLOADER_ARGUMENTS_SIZE, TAXEL_ENTER_BOOTLOADER_ARGUMENTS_SIZE},
    {TAXEL_COMMAND_GET_FAULT, 0, 0},
};

/* Return the status (enum taxel_reply_status) with which a command must be rejected, or OK if the handshake is done,
 * the command is defined, and the `size` of its arguments is within the limits. */
static uint8_t check_command(const struct taxel_hub *hub, uint8_t command, size_t size)
{
    if (!hub->version) {
        return TAXEL_REPLY_STATUS_NO_HANDSHAKE;
    }
    for (size_t i = 0; i < sizeof argument_rules / sizeof argument_rules[0]; i++) {
        if (argument_rules[i].command == command) {
            const bool fits = size >= argument_rules[i].minimum && size <= argument_rules[i].maximum;
            return fits ? TAXEL_REPLY_STATUS_OK : TAXEL_REPLY_STATUS_BAD_ARGUMENTS;
        }
    }
    return TAXEL_REPLY_STATUS_UNKNOWN_COMMAND;
}

/* Queue the reply to REBOOT or ENTER_BOOTLOADER, and request a reset of the processor after the reply has been sent. */
static void restart(struct taxel_hub *hub)
{
    hub->restart_requested = true;
    hub->restart_by_us = taxel_hub_now(hub) + RESTART_TIMEOUT_US;
    reply_ok(hub);
}

/* Execute the command ENTER_BOOTLOADER: restart into the hub's bootloader. The key in the arguments prevents an
 * accidental restart; a hub without a bootloader rejects the command. */
static void enter_bootloader(struct taxel_hub *hub, const uint8_t *arguments)
{
    if (!taxel_hub_hal_of(hub)->enter_bootloader) {
        taxel_hub_reply(hub, TAXEL_REPLY_STATUS_UNKNOWN_COMMAND, NULL, 0);
        return;
    }
    if (taxel_get_u32(arguments) != TAXEL_BOOTLOADER_KEY) {
        taxel_hub_reply(hub, TAXEL_REPLY_STATUS_BAD_ARGUMENTS, NULL, 0);
        return;
    }
    hub->bootloader_requested = true;
    restart(hub);
}

/* Execute a checked command. The reply is queued at once, or by the scheduler when the requested transfers have ended.
 */
static void execute_command(struct taxel_hub *hub, uint8_t command, const uint8_t *arguments, size_t size)
{
    switch (command) {
    case TAXEL_COMMAND_START:
        execute_start(hub, arguments, size);
        break;
    case TAXEL_COMMAND_STOP:
        hub->streaming = false;
        reply_ok(hub);
        break;
    case TAXEL_COMMAND_SET_RATE:
        set_rate(hub, arguments);
        break;
    case TAXEL_COMMAND_SCAN_BUS:
        taxel_hub_start_bus_scan(hub, true);
        break;
    case TAXEL_COMMAND_I2C_TRANSFER:
        request_transfer(hub, arguments, size);
        break;
    case TAXEL_COMMAND_SET_SCAN_SETTINGS:
        set_scan_settings(hub, arguments, size);
        break;
    case TAXEL_COMMAND_REBOOT:
        restart(hub);
        break;
    case TAXEL_COMMAND_ENTER_BOOTLOADER:
        enter_bootloader(hub, arguments);
        break;
    case TAXEL_COMMAND_GET_STATUS:
        taxel_hub_start_report(hub, true);
        break;
    case TAXEL_COMMAND_GET_BOARD_INFO:
        get_board_info(hub, arguments);
        break;
    case TAXEL_COMMAND_GET_FAULT:
        get_fault(hub);
        break;
    default:
        get_time(hub);
        break;
    }
}

/* Check and execute the COMMAND frame in the inbox; `size`: bytes of its payload. Called only after the reply to the
 * previous command has been queued. */
void taxel_hub_handle_command(struct taxel_hub *hub, size_t size)
{
    struct taxel_command_header header;
    const uint8_t *payload = hub->inbox.payload;
    taxel_command_header_unpack(&header, payload);
    hub->command.active = true;
    hub->command.tag = header.tag;
    hub->command.command = header.command;
    hub->inbox.commands++;
    size -= TAXEL_COMMAND_HEADER_SIZE;
    const uint8_t status = check_command(hub, header.command, size);
    if (status != TAXEL_REPLY_STATUS_OK) {
        taxel_hub_reply(hub, status, NULL, 0);
        return;
    }
    execute_command(hub, header.command, payload + TAXEL_COMMAND_HEADER_SIZE, size);
}
