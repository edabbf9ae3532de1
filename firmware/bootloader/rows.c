/* Writes to the free slot. Other rows of the flash cannot be written by these commands. */
#include "bootloader/internal.h"

/* Append data to the row buffer. Returns status OK; if the data do not fit, clears the buffer and returns status
 * LENGTH. */
static uint8_t append(struct taxel_boot *boot, const uint8_t *data, unsigned size)
{
    if (size > TAXEL_BOOT_ROW_SIZE - boot->fill) {
        boot->fill = 0;
        return TAXEL_BOOT_STATUS_LENGTH;
    }
    memcpy(boot->row + boot->fill, data, size);
    boot->fill = (uint8_t)(boot->fill + size);
    return TAXEL_BOOT_STATUS_OK;
}

/* Execute the command SEND_DATA: append the data of the packet to the row buffer. Returns the status of the response,
 * which has no data. */
uint8_t taxel_boot_send_data(struct taxel_boot *boot, const struct taxel_boot_packet *packet, uint8_t *reply)
{
    (void)reply;
    return append(boot, packet->data, packet->length);
}

/* Read the number of the flash row from the data of a packet. */
static uint16_t row_of(const struct taxel_boot_packet *packet)
{
    return taxel_get_u16(packet->data + TAXEL_BOOT_ROW_ADDRESS_OFFSET_ROW);
}

/* Return the status with which a packet's flash row address must be answered: OK, ARRAY for an array other than 0, or
 * ROW for a row that does not exist. */
static uint8_t address_status(const struct taxel_boot_packet *packet)
{
    if (packet->data[TAXEL_BOOT_ROW_ADDRESS_OFFSET_ARRAY] != 0) {
        return TAXEL_BOOT_STATUS_ARRAY;
    }
    return row_of(packet) < TAXEL_BOOT_ROW_COUNT ? TAXEL_BOOT_STATUS_OK : TAXEL_BOOT_STATUS_ROW;
}

/* Return whether flash row `row` belongs to `slot` (0 or 1). The unsigned difference also rejects rows before the
 * slot. */
static bool is_in_slot(const struct taxel_boot *boot, uint8_t slot, unsigned row)
{
    const struct taxel_boot_layout *const layout = boot->config->flash.layout;
    return row - layout->first_rows[slot] < layout->slot_rows;
}

/* Write the row buffer to the flash row of the packet, if this row belongs to the free slot (the only slot that the
 * host may write), and mark the buffer as empty. Returns the status of the response: ACTIVE for a row of the other
 * slot, ROW_PROTECTED for a row outside both slots. */
static uint8_t write_row(struct taxel_boot *boot, const struct taxel_boot_packet *packet)
{
    const uint16_t row = row_of(packet);
    const uint8_t target = taxel_boot_target(boot);
    uint8_t status = address_status(packet);
    boot->fill = 0;
    if (status) {
        return status;
    }
    if (!is_in_slot(boot, target, row)) {
        return is_in_slot(boot, target ^ 1u, row) ? TAXEL_BOOT_STATUS_ACTIVE : TAXEL_BOOT_STATUS_ROW_PROTECTED;
    }
#ifdef TAXEL_BOOT_ONE_SLOT
    /* Before the first row is overwritten: the only image is incomplete from now on and must not start. */
    if (!boot->programmed && taxel_boot_metadata_forget(&boot->config->flash)) {
        return TAXEL_BOOT_STATUS_VERIFY;
    }
#endif
    boot->programmed = true;
    return taxel_boot_write_row(&boot->config->flash, row, boot->row) ? TAXEL_BOOT_STATUS_VERIFY : TAXEL_BOOT_STATUS_OK;
}

/* Execute the command PROGRAM_ROW: write one flash row from the data of earlier SEND_DATA packets and of this packet,
 * which must fill the row exactly (otherwise status LENGTH). Returns the status of the response, which has no data. */
uint8_t taxel_boot_program_row(struct taxel_boot *boot, const struct taxel_boot_packet *packet, uint8_t *reply)
{
    (void)reply;
    if (packet->length < TAXEL_BOOT_ROW_ADDRESS_SIZE) {
        return TAXEL_BOOT_STATUS_LENGTH;
    }
    const uint8_t status = append(boot, packet->data + TAXEL_BOOT_ROW_ADDRESS_SIZE,
                                  (unsigned)packet->length - TAXEL_BOOT_ROW_ADDRESS_SIZE);
    if (status == TAXEL_BOOT_STATUS_OK && boot->fill != TAXEL_BOOT_ROW_SIZE) {
        boot->fill = 0;
        return TAXEL_BOOT_STATUS_LENGTH;
    }
    return status ? status : write_row(boot, packet);
}

/* Execute the command ERASE_ROW: write zeros to one flash row. Returns the status of the response, which has no
 * data. */
uint8_t taxel_boot_erase_row(struct taxel_boot *boot, const struct taxel_boot_packet *packet, uint8_t *reply)
{
    (void)reply;
    memset(boot->row, 0, sizeof boot->row); /* the content of erased flash */
    return write_row(boot, packet);
}

/* Execute the command VERIFY_ROW: reply with the low byte of the two's complement of the sum of a flash row's bytes.
 * Returns the status of the row address. */
uint8_t taxel_boot_verify_row(struct taxel_boot *boot, const struct taxel_boot_packet *packet, uint8_t *reply)
{
    const uint8_t status = address_status(packet);
    if (status == TAXEL_BOOT_STATUS_OK) {
        reply[0] = (uint8_t)taxel_boot_packet_checksum(taxel_boot_row(&boot->config->flash, row_of(packet)),
                                                       TAXEL_BOOT_ROW_SIZE, TAXEL_BOOT_CHECKSUM_SUM);
    }
    return status;
}

/* Execute the command VERIFY_APPLICATION: reply with 1 if the free slot contains a valid image, otherwise 0. A valid
 * image that was programmed in this session becomes the pending image, which is started next. Returns status VERIFY if
 * this cannot be recorded, otherwise OK. */
uint8_t taxel_boot_verify_application(struct taxel_boot *boot, const struct taxel_boot_packet *packet, uint8_t *reply)
{
    const struct taxel_boot_flash *const flash = &boot->config->flash;
    const uint8_t target = taxel_boot_target(boot);
    (void)packet;
    reply[0] = taxel_boot_image(flash, target) != NULL;
    if (reply[0] && boot->programmed && taxel_boot_metadata_set_pending(flash, target)) {
        return TAXEL_BOOT_STATUS_VERIFY;
    }
    return TAXEL_BOOT_STATUS_OK;
}
