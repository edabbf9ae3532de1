#include "fuzz/board_model.h"

#include "fuzz/fuzz.h"

#define FLAG_SETTINGS 0x01u
#define FLAG_COMMAND 0x02u
#define FLAG_SATURATED 0x08u
#define FLAG_READ_ONLY 0x10u

/* Increment a 16-bit counter, which stays at 65535 once it has reached this value. */
static void increment_saturating(uint16_t *counter)
{
    *counter = (uint16_t)(*counter + (*counter < 0xFFFF));
}

/* Return the number of bytes of a snapshot of the modelled board: 6 bytes of header, 2 bytes per taxel, 4 bytes of
 * CRC. */
static size_t snapshot_size(const struct board_model *model)
{
    return 10u + 2u * (size_t)model->taxel_count;
}

/* Return whether a board must accept these 8 bytes of scan settings: the largest possible raw count (sub-conversions
 * times sense clock divider, both 16 bits) is 1 to 65535, and modulator clock divider and IDAC code are not 0. */
bool model_settings_are_valid(const uint8_t settings[MODEL_SETTINGS_SIZE])
{
    const uint64_t largest = (uint64_t)(settings[0] | settings[1] << 8) * (uint64_t)(settings[2] | settings[3] << 8);
    return largest >= 1 && largest <= 65535 && settings[4] && settings[5];
}

/* Reset the model of a sensor board. Afterwards identity register and settings are those after power-on; I2C address,
 * reset cause, wiring, boot settings and clock are kept. The byte layout of the identity register is written out here,
 * independently of the generated code under test. */
void model_boot(struct board_model *model, const uint8_t version[3], uint8_t kind, const uint8_t unique_id[8])
{
    const struct board_model old = *model;
    memset(model, 0, sizeof *model);
    model->address = old.address;
    model->reset_cause = old.reset_cause;
    model->rows = old.rows;
    model->columns = old.columns;
    model->taxel_count = old.taxel_count;
    model->clock_us = old.clock_us;
    memcpy(model->crossing_map, old.crossing_map, sizeof model->crossing_map);
    memcpy(model->boot_settings, old.boot_settings, sizeof model->boot_settings);
    memcpy(model->settings, old.boot_settings, sizeof model->settings);
    uint8_t *const id = model->identity;
    /* who_am_i, map version, firmware version, kind, address, map revision */
    const uint8_t head[8] = {0x54, 1, version[0], version[1], version[2], kind, model->address, 1};
    memcpy(id, head, sizeof head);
    memcpy(id + 8, unique_id, 8);
    id[16] = model->rows;
    id[17] = model->columns;
    fuzz_put_u16(id + 18, model->taxel_count);
    fuzz_put_u16(id + 20, (uint32_t)snapshot_size(model));
    memcpy(id + 22, model->crossing_map, 32);
    fuzz_put_u32(id + 54, fuzz_crc32(0, id, 54));
    model->front_end_configurations = 1;
}

/* Start a scan of the model: pending settings take effect, sequence number and start time are stored in the snapshot,
 * and the conversion of the first taxel begins. */
static void begin_scan(struct board_model *model)
{
    if (model->settings_pending) {
        model->settings_pending = false;
        model->settings_generation++;
        model->front_end_configurations++;
        memcpy(model->settings, model->next_settings, sizeof model->settings);
    }
    model->taxel = 0;
    model->started_us = model->clock_us;
    fuzz_put_u16(model->being_scanned.bytes, model->scans);
    fuzz_put_u32(model->being_scanned.bytes + 2, model->clock_us);
    model->converting = true;
    model->conversions_started++;
}

/* Start continuous scans of the model, unless they are running. A conversion may still be running that began before the
 * scans were stopped. Its result will be discarded, and the first scan begins when this conversion ends. */
void model_start(struct board_model *model)
{
    if (model->scanning) {
        return;
    }
    model->scanning = true;
    if (model->converting) {
        model->dropped_conversion = true;
    } else {
        begin_scan(model);
    }
}

/* Return the index (tx * columns + rx) of the crossing of the taxel being converted, or 0xFFFF if the crossing map has
 * fewer taxels. */
uint16_t model_crossing(const struct board_model *model)
{
    unsigned remaining = model->taxel;
    for (uint16_t crossing = 0; crossing < 256; crossing++) {
        if (model->crossing_map[crossing / 8] >> (crossing % 8) & 1 && remaining-- == 0) {
            return crossing;
        }
    }
    return 0xFFFF;
}

/* Complete a scan of the model: append the CRC over I2C address and snapshot, and copy the snapshot to `newest`. */
static void complete_scan(struct board_model *model)
{
    uint8_t *const bytes = model->being_scanned.bytes;
    const size_t size = snapshot_size(model);
    fuzz_put_u32(bytes + size - 4, fuzz_crc32(fuzz_crc32(0, &model->address, 1), bytes, size - 4));
    model->scan_time_us = model->clock_us - model->started_us;
    model->scans++;
    memcpy(model->newest.bytes, bytes, size);
    model->newest.exists = true;
}

/* End the running conversion of the model with this raw count; 0 means a saturated conversion. Then the next conversion
 * begins; after the last taxel, it is the first conversion of a new scan. A stopped board discards the raw count and
 * starts no conversion. The raw count of a conversion that began before a stop is also discarded (model_start()). */
void model_conversion(struct board_model *model, uint16_t raw_count)
{
    const bool is_dropped = model->dropped_conversion;
    model->converting = model->dropped_conversion = false;
    if (!model->scanning) {
        return;
    }
    if (is_dropped) {
        begin_scan(model);
        return;
    }
    fuzz_put_u16(model->being_scanned.bytes + 6u + 2u * model->taxel, raw_count);
    if (raw_count == 0) {
        increment_saturating(&model->saturated_conversions);
        model->error_flags |= FLAG_SATURATED;
    }
    if (++model->taxel < model->taxel_count) {
        model->converting = true;
        model->conversions_started++;
        return;
    }
    complete_scan(model);
    begin_scan(model);
}

/* Prepare the register content that the next reads return: byte `position` of `bytes` first. */
static void answer_with(struct board_model *model, const uint8_t *bytes, size_t size, size_t position)
{
    memcpy(model->answer, bytes, size);
    model->answer_size = size;
    model->answer_position = position;
}

/* Prepare the answer to a read of the status registers, 0x40 to 0x5B, from the byte on that the pointer selects. */
static void answer_with_status(struct board_model *model)
{
    uint8_t bytes[28] = {model->scanning, model->error_flags, model->reset_cause, model->settings_generation};
    fuzz_put_u32(bytes + 4, model->clock_us);
    fuzz_put_u32(bytes + 8, model->scans);
    fuzz_put_u32(bytes + 12, model->scan_time_us);
    fuzz_put_u32(bytes + 16, model->snapshot_reads);
    fuzz_put_u16(bytes + 20, model->bus_errors);
    fuzz_put_u16(bytes + 22, model->rejected_writes);
    fuzz_put_u16(bytes + 26, model->saturated_conversions);
    answer_with(model, bytes, sizeof bytes, model->pointer - 0x40u);
}

/* Prepare the answer to a read of the settings register: settings and CRC, from the byte on that the pointer selects.
 * Settings that wait for the next scan are returned instead of those in use. */
static void answer_with_settings(struct board_model *model)
{
    uint8_t bytes[12];
    memcpy(bytes, model->settings_pending ? model->next_settings : model->settings, 8);
    fuzz_put_u32(bytes + 8, fuzz_crc32(fuzz_crc32(0, &model->address, 1), bytes, 8));
    answer_with(model, bytes, sizeof bytes, model->pointer - 0x60u);
}

/* Prepare the answer to a read of the fault register 0x90: 12 zero bytes, which mean no fault, and their CRC. */
static void answer_with_no_fault(struct board_model *model)
{
    uint8_t bytes[16] = {0};
    fuzz_put_u32(bytes + 12, fuzz_crc32(fuzz_crc32(0, &model->address, 1), bytes, 12));
    answer_with(model, bytes, sizeof bytes, 0);
}

/* Prepare the answer to a read of the snapshot registers: 0x80 + n returns the latched snapshot from byte 32 n on. A
 * read of register 0x80 is counted, and first latches the newest snapshot if there is one. Returns false (the board
 * answers with NACK) if no snapshot is latched. */
static bool answer_with_snapshot(struct board_model *model)
{
    if (model->pointer == 0x80 && model->newest.exists) {
        memcpy(model->latched.bytes, model->newest.bytes, snapshot_size(model));
        model->latched.exists = true;
        model->newest.exists = false;
    }
    if (!model->latched.exists) {
        return false;
    }
    model->snapshot_reads += model->pointer == 0x80;
    answer_with(model, model->latched.bytes, snapshot_size(model), 32u * (model->pointer - 0x80u));
    return true;
}

/* Address the model for a read (`reading`) or a write. A read prepares the content of the register at the pointer; the
 * first byte of a write will be the pointer. Register addresses between the known ranges have no content and read as
 * 0xFF. Returns whether the board acknowledges. */
bool model_address(struct board_model *model, bool reading)
{
    model->refused = false;
    model->written_size = 0;
    model->pointer_next = !reading;
    if (!reading) {
        return true;
    }
    if (model->pointer >= 0x80 && model->pointer <= 0x8F) {
        return answer_with_snapshot(model);
    }
    if (model->pointer < 0x3A) {
        answer_with(model, model->identity, sizeof model->identity, model->pointer);
    } else if (model->pointer >= 0x40 && model->pointer < 0x5C) {
        answer_with_status(model);
    } else if (model->pointer >= 0x60 && model->pointer < 0x6C) {
        answer_with_settings(model);
    } else if (model->pointer == 0x90) {
        answer_with_no_fault(model);
    } else {
        answer_with(model, model->identity, 0, 0);
    }
    return true;
}

/* Return the next byte that the board must send to the master; 0xFF after the end of the register content. */
uint8_t model_read(struct board_model *model)
{
    return model->answer_position < model->answer_size ? model->answer[model->answer_position++] : 0xFF;
}

/* Count a rejected write and set `flag` in the error flags of the model. */
static void reject(struct board_model *model, uint8_t flag)
{
    increment_saturating(&model->rejected_writes);
    model->error_flags |= flag;
}

/* Write a byte of the master to the model: the register pointer, or data that take effect at the stop condition. Data
 * of more than MODEL_WRITE_MAX bytes are a rejected write. Returns whether the board acknowledges. */
bool model_write(struct board_model *model, uint8_t byte)
{
    if (model->pointer_next) {
        model->pointer_next = false;
        model->pointer = byte;
        return true;
    }
    if (model->refused) {
        return false;
    }
    if (model->written_size == MODEL_WRITE_MAX) {
        model->written_size = 0;
        model->refused = true;
        reject(model, FLAG_READ_ONLY);
        return false;
    }
    model->written[model->written_size++] = byte;
    return true;
}

/* Execute a write to the settings register 0x60: 8 bytes of settings and a CRC that covers I2C address and settings.
 * Valid settings wait for the next scan; others are a rejected write. */
static void take_settings(struct board_model *model)
{
    uint8_t crc[4];
    fuzz_put_u32(crc, fuzz_crc32(fuzz_crc32(0, &model->address, 1), model->written, 8));
    if (model->written_size != 12 || !model_settings_are_valid(model->written) ||
        memcmp(crc, model->written + 8, 4) != 0) {
        reject(model, FLAG_SETTINGS);
        return;
    }
    memcpy(model->next_settings, model->written, sizeof model->next_settings);
    model->settings_pending = true;
}

/* Execute a write to the command register 0x70: command code and its complement. Codes: 1 start scans, 2 stop scans, 3
 * clear counters, 4 restart, 5 enter the bootloader. Code 5 needs the four characters BOOT after the complement.
 * Anything else is a rejected write. */
static void take_command(struct board_model *model)
{
    const bool has_key = model->written_size == 6 && memcmp(model->written + 2, "BOOT", 4) == 0;
    const bool has_size = model->written[0] == 5 ? has_key : model->written_size == 2;
    const bool is_whole = model->written_size >= 2 && has_size && model->written[0] + model->written[1] == 0xFF;
    switch (is_whole ? model->written[0] : 0) {
    case 1:
        model_start(model);
        break;
    case 2:
        model->scanning = false;
        break;
    case 3:
        model->error_flags = 0;
        model->bus_errors = model->rejected_writes = model->saturated_conversions = 0;
        model->snapshot_reads = 0;
        break;
    case 4:
        model->restart_requested = true;
        break;
    case 5:
        model->bootloader_requested = true;
        break;
    default:
        reject(model, FLAG_COMMAND);
        break;
    }
}

/* End a transfer of the model with a stop condition, at which written bytes take effect. Bytes written to a register
 * other than 0x60 (settings) and 0x70 (command) are a rejected write. */
void model_stop(struct board_model *model)
{
    if (model->written_size && model->pointer == 0x60) {
        take_settings(model);
    } else if (model->written_size && model->pointer == 0x70) {
        take_command(model);
    } else if (model->written_size) {
        reject(model, FLAG_READ_ONLY);
    }
    model->written_size = 0;
    model->pointer_next = false;
}

/* Model a start or stop condition at a wrong position: the bus error is counted, and the bytes of this write are
 * discarded. */
void model_bus_error(struct board_model *model)
{
    increment_saturating(&model->bus_errors);
    model->written_size = 0;
    model->pointer_next = false;
}
