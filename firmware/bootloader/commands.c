#include "bootloader/internal.h"

#define ANY_LENGTH 0xFFu

/* Execute the command ENTER: begin a session with the host, which must send the key if a key is configured, and
 * determine the kept slot (the slot that the session must not overwrite). The reply contains silicon id, silicon
 * revision and bootloader version. */
static uint8_t enter_session(struct taxel_boot *boot, const struct taxel_boot_packet *packet, uint8_t *reply)
{
    const struct taxel_boot_config *const config = boot->config;
    if (packet->length != 0 && packet->length != TAXEL_BOOT_KEY_SIZE) {
        return TAXEL_BOOT_STATUS_LENGTH;
    }
    if (config->key && (packet->length == 0 || memcmp(packet->data, config->key, TAXEL_BOOT_KEY_SIZE) != 0)) {
        return TAXEL_BOOT_STATUS_KEY;
    }
    boot->entered = true;
    boot->programmed = false;
    boot->fill = 0;
    boot->kept_slot = taxel_boot_kept_slot(&config->flash);
    if (boot->stay == TAXEL_BOOT_STAY_LISTENING) {
        boot->stay = TAXEL_BOOT_STAY_HOST; /* otherwise an image would start when the listening time ends */
    }
    taxel_boot_put_u32(reply, TAXEL_BOOT_SILICON_ID);
    reply[TAXEL_BOOT_ENTER_REPLY_OFFSET_REVISION] = config->silicon_revision;
    memcpy(reply + TAXEL_BOOT_ENTER_REPLY_OFFSET_BOOTLOADER_VERSION, config->version, sizeof config->version);
    return TAXEL_BOOT_STATUS_OK;
}

/* Execute the command SYNC: discard the data of earlier SEND_DATA packets. Always returns status OK. */
static uint8_t synchronize(struct taxel_boot *boot, const struct taxel_boot_packet *packet, uint8_t *reply)
{
    (void)packet;
    (void)reply;
    boot->fill = 0;
    return TAXEL_BOOT_STATUS_OK;
}

/* Execute the command SET_ACTIVE: select the image that is started after the next reset. Returns status APPLICATION if
 * the image is invalid, VERIFY if the metadata cannot be written, otherwise OK. */
static uint8_t set_active(struct taxel_boot *boot, const struct taxel_boot_packet *packet, uint8_t *reply)
{
    const struct taxel_boot_flash *const flash = &boot->config->flash;
    const uint8_t slot = packet->data[0];
    (void)reply;
    if (!taxel_boot_image(flash, slot)) {
        return TAXEL_BOOT_STATUS_APPLICATION;
    }
    return taxel_boot_metadata_set_pending(flash, slot) ? TAXEL_BOOT_STATUS_VERIFY : TAXEL_BOOT_STATUS_OK;
}

/* Execute the command EXIT: request a restart, which starts the application. Always returns status OK. */
static uint8_t leave_session(struct taxel_boot *boot, const struct taxel_boot_packet *packet, uint8_t *reply)
{
    (void)packet;
    (void)reply;
    boot->restart_requested = true;
    return TAXEL_BOOT_STATUS_OK;
}

struct command {
    taxel_boot_handler *handler;
    uint8_t code;
    uint8_t length; /* of the packet's data */
    uint8_t reply_length;
    bool needs_enter;
};

static const struct command commands[] = {
    {taxel_boot_verify_application, TAXEL_BOOT_COMMAND_VERIFY_APPLICATION, 0, 1, true},
    {taxel_boot_get_flash_size, TAXEL_BOOT_COMMAND_GET_FLASH_SIZE, 1, TAXEL_BOOT_FLASH_SIZE_REPLY_SIZE, true},
    {taxel_boot_get_application_status, TAXEL_BOOT_COMMAND_GET_APPLICATION_STATUS, 1, 2, true},
    {taxel_boot_erase_row, TAXEL_BOOT_COMMAND_ERASE_ROW, TAXEL_BOOT_ROW_ADDRESS_SIZE, 0, true},
    {synchronize, TAXEL_BOOT_COMMAND_SYNC, 0, 0, true},
    {set_active, TAXEL_BOOT_COMMAND_SET_ACTIVE, 1, 0, true},
    {taxel_boot_send_data, TAXEL_BOOT_COMMAND_SEND_DATA, ANY_LENGTH, 0, true},
    {enter_session, TAXEL_BOOT_COMMAND_ENTER, ANY_LENGTH, TAXEL_BOOT_ENTER_REPLY_SIZE, false},
    {taxel_boot_program_row, TAXEL_BOOT_COMMAND_PROGRAM_ROW, ANY_LENGTH, 0, true},
    {taxel_boot_verify_row, TAXEL_BOOT_COMMAND_VERIFY_ROW, TAXEL_BOOT_ROW_ADDRESS_SIZE, 1, true},
    {leave_session, TAXEL_BOOT_COMMAND_EXIT, 0, 0, true},
    {taxel_boot_get_metadata, TAXEL_BOOT_COMMAND_GET_METADATA, 1, TAXEL_BOOT_STOCK_METADATA_SIZE, true},
    {taxel_boot_get_info, TAXEL_BOOT_COMMAND_GET_INFO, 0, TAXEL_BOOT_INFO_SIZE, false},
    {taxel_boot_search, TAXEL_BOOT_COMMAND_SEARCH, TAXEL_BOOT_SEARCH_ARGUMENTS_SIZE, TAXEL_BOOT_SEARCH_REPLY_SIZE,
     false},
    {taxel_boot_read_configuration, TAXEL_BOOT_COMMAND_READ_CONFIGURATION, 0, TAXEL_BOOT_CONFIGURATION_SIZE, false},
    {taxel_boot_write_configuration, TAXEL_BOOT_COMMAND_WRITE_CONFIGURATION,
     TAXEL_BOOT_WRITE_CONFIGURATION_ARGUMENTS_SIZE, 0, true},
};

/* Execute a parsed packet with the handler of its command. Returns the status; `reply` and `length` receive the data of
 * the response and their number of bytes. Status COMMAND: an unknown command, or one that is not permitted before
 * ENTER. */
static uint8_t execute_packet(struct taxel_boot *boot, const struct taxel_boot_packet *packet, uint8_t *reply,
                              uint8_t *length)
{
    for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++) {
        const struct command *const command = &commands[i];
        if (command->code != packet->command || (command->needs_enter && !boot->entered)) {
            continue;
        }
        if (command->length != ANY_LENGTH && command->length != packet->length) {
            return TAXEL_BOOT_STATUS_LENGTH;
        }
        *length = command->reply_length;
        return command->handler(boot, packet, reply);
    }
    return TAXEL_BOOT_STATUS_COMMAND;
}

/* Parse a received packet and return TAXEL_BOOT_STATUS_OK or the failure status of the response. If the configuration
 * permits both checksums, a packet before the session or an ENTER packet may use the other one, which applies from then
 * on. */
static uint8_t parse(struct taxel_boot *boot, struct taxel_boot_packet *packet, const uint8_t *bytes, size_t size)
{
    const uint8_t other = boot->checksum ^ 1u; /* the two checksums have the codes 0 (sum) and 1 (CRC) */
    uint8_t status = taxel_boot_packet_parse(packet, bytes, size, boot->checksum);
    if (status == TAXEL_BOOT_STATUS_CHECKSUM && boot->config->checksum == TAXEL_BOOT_CHECKSUM_ANY &&
        (!boot->entered || bytes[1] == TAXEL_BOOT_COMMAND_ENTER)) {
        status = taxel_boot_packet_parse(packet, bytes, size, other);
        boot->checksum = status ? boot->checksum : other;
    }
    return status;
}

/* Execute a received packet and write the response packet to `response`; returns its size in bytes. 0: no response,
 * after a successful SYNC or EXIT, and from a board that a SEARCH command has silenced. */
size_t taxel_boot_take_packet(struct taxel_boot *boot, const uint8_t *bytes, size_t size, uint8_t *response)
{
    struct taxel_boot_packet packet;
    uint8_t length = 0;
    uint8_t status = parse(boot, &packet, bytes, size);
    if (boot->silent && (status || packet.command != TAXEL_BOOT_COMMAND_SEARCH)) {
        return 0;
    }
    if (status == TAXEL_BOOT_STATUS_OK) {
        status = execute_packet(boot, &packet, response + TAXEL_BOOT_DATA_OFFSET, &length);
        const bool is_mute =
            boot->silent || packet.command == TAXEL_BOOT_COMMAND_SYNC || packet.command == TAXEL_BOOT_COMMAND_EXIT;
        if (is_mute && status == TAXEL_BOOT_STATUS_OK) {
            return 0;
        }
    }
    return taxel_boot_packet_build(response, status, status ? 0 : length, boot->checksum);
}
