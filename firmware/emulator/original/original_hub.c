#include "emulator/original/original_hub.h"

#include <string.h>

static const uint8_t start_command[1] = {ORIGINAL_START_COMMAND};

/* Set up the hub before its first reset. With the fault `receive_buffer`, the message begins inside the memory of a
 * long read, so that the read overwrites it. baud: of the UART. clock_rate: of the hub's oscillator, relative to its
 * nominal frequency. */
void original_hub_init(struct original_hub *hub, const struct original_settings *settings,
                       const struct original_hub_hal *hal, double baud, double clock_rate)
{
    memset(hub, 0, sizeof *hub);
    hub->settings = settings;
    hub->hal = *hal;
    hub->clock_rate = clock_rate;
    hub->message_offset = settings->faults & ORIGINAL_RECEIVE_BUFFER ? ORIGINAL_RECEIVE_SIZE : ORIGINAL_READ_SIZE_MAX;
    hub->wake = VTIME_NEVER;
    original_sender_init(&hub->sender, settings, baud, clock_rate);
}

/* Add the time since the last call to `sum`, one of the sums (call, read, retry, blocked, delay time) of the account,
 * which states for what the hub uses its time. */
static void account_time(struct original_hub *hub, vtime *sum, vtime now)
{
    *sum += now - hub->account_mark;
    hub->account_mark = now;
}

/* Return the account with the sums of the UART driver at virtual time `now`. */
static struct original_account read_account(const struct original_hub *hub, vtime now)
{
    struct original_account account = hub->account;
    account.wire_time = hub->sender.wire_time;
    account.pacing_time = hub->sender.pacing_time;
    account.wire_bytes = hub->sender.bytes;
    account.time = now;
    return account;
}

/* Start a transfer on the I2C bus; the main program waits for its end. */
static void start_transfer(struct original_hub *hub, const struct taxel_i2c_transfer *transfer)
{
    hub->transfer_is_done = false;
    hub->wake = VTIME_NEVER;
    hub->hal.start_transfer(hub->hal.context, transfer);
}

/* Count the cycle that ends at `now` if a message was sent in it. Cycles without a message, in which all boards still
 * start, are not counted. The account at the end of the first counted cycle is stored, because this cycle is not
 * representative: not all boards may have been ready. */
static void close_cycle(struct original_hub *hub, vtime now)
{
    if (hub->account.messages == hub->messages_before) {
        return;
    }
    hub->messages_before = hub->account.messages;
    hub->account.cycles++;
    hub->last_cycle = read_account(hub, now);
    if (hub->account.cycles == 1u) {
        hub->first_cycle = hub->last_cycle;
    }
}

/* Begin a cycle with the general call, an I2C write to address 0, which requests counts from all boards at once. */
static void begin_cycle(struct original_hub *hub, vtime now)
{
    const struct taxel_i2c_transfer call = {
        .address = 0, .write_bytes = start_command, .write_size = sizeof start_command};
    close_cycle(hub, now);
    memset(hub->is_done, 0, sizeof hub->is_done);
    memset(hub->failed_tries, 0, sizeof hub->failed_tries);
    hub->state = ORIGINAL_HUB_CALLS;
    start_transfer(hub, &call);
}

/* Begin the delay between two cycles. */
static void begin_delay(struct original_hub *hub, vtime now)
{
    hub->state = ORIGINAL_HUB_DELAYS;
    hub->delay_end = now + (vtime)(hub->settings->delay_ms / hub->clock_rate * (double)VTIME_MS);
    hub->wake = hub->delay_end;
}

/* Return whether a board of the list must still be read in this cycle. */
static bool is_to_read(const struct original_hub *hub, size_t board)
{
    return !hub->is_done[board] && !hub->is_offline[board];
}

/* Start the read of the next board that must still be read in this cycle, from list index `first` on. After the last
 * board the search continues with the first board, without a pause. If no board must be read, the cycle ends. */
static void read_next_board(struct original_hub *hub, size_t first, vtime now)
{
    const size_t count = hub->settings->list_size;
    for (size_t i = 0; i < count; i++) {
        const size_t board = (first + i) % count;
        if (is_to_read(hub, board)) {
            const struct original_board_entry *entry = &hub->settings->list[board];
            const struct taxel_i2c_transfer read = {.address = entry->address,
                                                    .read_bytes = hub->memory,
                                                    .read_size = ORIGINAL_STATUS_SIZE + 2u * entry->words};
            hub->board = board;
            hub->state = ORIGINAL_HUB_READS;
            start_transfer(hub, &read);
            return;
        }
    }
    begin_delay(hub, now);
}

/* Count a failed try of the present board. Its consequence depends on the variant of the hub. */
static void count_failed_try(struct original_hub *hub)
{
    const size_t board = hub->board;
    hub->account.failed_tries++;
    hub->failed_tries[board]++;
    if (hub->settings->variant == ORIGINAL_MAIN && hub->failed_tries[board] == ORIGINAL_TRIES_MAIN) {
        hub->is_done[board] = true; /* skipped in this cycle */
    }
    if (hub->settings->variant == ORIGINAL_BRANCH && hub->failed_tries[board] == ORIGINAL_TRIES_BRANCH) {
        hub->is_offline[board] = true; /* until the hub is reset */
    }
}

/* Return the timestamp (ms) of a message that is built now. The hub triggers the interrupt that adds the 16-bit timer
 * to the sum and restarts the timer. With the fault `stale_timestamp`, the sum is read before the interrupt. */
static uint32_t take_timestamp(struct original_hub *hub, vtime now)
{
    const uint32_t stale = hub->timestamp_ms;
    const uint64_t clock_ms = (uint64_t)((double)(now - hub->reset_time) * hub->clock_rate / (double)VTIME_MS);
    hub->timestamp_ms += (uint16_t)(clock_ms - hub->timer_start_ms); /* the timer wraps after 65.5 s */
    hub->timer_start_ms = clock_ms;
    return hub->settings->faults & ORIGINAL_STALE_TIMESTAMP ? stale : hub->timestamp_ms;
}

/* Write address, timestamp and the counts of the receive buffer to the message; returns its size in bytes. The counts
 * are copied byte by byte from lower to higher addresses, as in the original: with the fault `receive_buffer`, source
 * and destination overlap. */
static size_t build_message(struct original_hub *hub, vtime now)
{
    const struct original_board_entry *entry = &hub->settings->list[hub->board];
    const bool is_swapped = hub->settings->message == ORIGINAL_HIGH_BYTE_FIRST;
    uint8_t *message = hub->memory + hub->message_offset;
    size_t size = 0;
    const uint32_t timestamp_ms = take_timestamp(hub, now);
    message[size++] = entry->address;
    for (unsigned shift = 32; hub->settings->message != ORIGINAL_WITHOUT_TIMESTAMP && shift; shift -= 8) {
        message[size++] = (uint8_t)(timestamp_ms >> (shift - 8u)); /* big-endian */
    }
    for (size_t i = 0; i < 2u * entry->words; i++) {
        message[size++] = hub->memory[ORIGINAL_STATUS_SIZE + (is_swapped ? i ^ 1u : i)];
    }
    return size;
}

/* Frame the message of the board that was read, and put it into the ring. With the fault `wrong_buffer` the frame
 * contains the first n + 5 bytes of the receive buffer (n: number of words of the board) in place of the message. */
static void send_message(struct original_hub *hub, vtime now)
{
    size_t size = build_message(hub, now);
    const uint8_t *source = hub->memory + hub->message_offset;
    if (hub->settings->faults & ORIGINAL_WRONG_BUFFER) {
        source = hub->memory;
        size = hub->settings->list[hub->board].words + 5u;
    }
    hub->frame[0] = TAXEL_ORIGINAL_START;
    hub->frame[1] = (uint8_t)(size + 3u);
    memcpy(hub->frame + 2, source, size);
    hub->frame[size + 2u] = TAXEL_ORIGINAL_END;
    hub->account.messages++;
    hub->state = ORIGINAL_HUB_SENDS;
    hub->wake = VTIME_NEVER;
    original_sender_put(&hub->sender, hub->frame, size + 3u, now);
    if (!hub->settings->is_paced) {
        hub->hal.start_transmit(hub->hal.context);
    }
}

/* Evaluate the result of a general call or read that has ended, and continue the cycle. A bus that is held makes the
 * hub hang for ever with the fault `wait_for_ever`. */
static void end_transfer(struct original_hub *hub, vtime now)
{
    const bool is_busy = hub->transfer_result == TAXEL_I2C_BUSY;
    const bool is_call = hub->state == ORIGINAL_HUB_CALLS;
    const bool is_read =
        !is_call && hub->transfer_result == TAXEL_I2C_OK && taxel_get_u16(hub->memory) == ORIGINAL_STATUS_READY;
    struct original_account *account = &hub->account;
    account_time(hub, is_call ? &account->call_time : is_read ? &account->read_time : &account->retry_time, now);
    if (is_busy && (hub->settings->faults & ORIGINAL_WAIT_FOR_EVER)) {
        hub->state = ORIGINAL_HUB_HANGS; /* waits for a flag that is never set */
        hub->wake = VTIME_NEVER;
    } else if (is_call && hub->transfer_result == TAXEL_I2C_OK) {
        read_next_board(hub, 0, now);
    } else if (is_call) {
        begin_delay(hub, now);
    } else if (is_read) {
        hub->is_done[hub->board] = true;
        send_message(hub, now);
    } else {
        count_failed_try(hub);
        read_next_board(hub, hub->board + 1u, now);
    }
}

/* Reset the hub (power-up or reset): the first cycle begins at `now`. */
void original_hub_reset(struct original_hub *hub, vtime now)
{
    original_sender_reset(&hub->sender, now);
    memset(hub->is_offline, 0, sizeof hub->is_offline);
    hub->reset_time = hub->account_mark = now;
    hub->timestamp_ms = 0;
    hub->timer_start_ms = 0;
    hub->transfer_is_done = false;
    hub->state = ORIGINAL_HUB_DELAYS;
    hub->delay_end = hub->wake = now;
}

/* Record the result of a transfer that has ended, and wake the main program. */
void original_hub_on_transfer_done(struct original_hub *hub, int8_t result, vtime now)
{
    hub->transfer_is_done = true;
    hub->transfer_result = result;
    hub->wake = now;
}

/* Let the main program continue at `now` if it was waiting for the ring and the whole message is now in the ring. */
static void wake_if_sent(struct original_hub *hub, vtime now)
{
    if (hub->state == ORIGINAL_HUB_SENDS && original_sender_is_free(&hub->sender)) {
        hub->wake = vtime_min(hub->wake, now);
    }
}

/* Copy the next bytes to send when the UART's wire is free. Returns their number. */
size_t original_hub_pull(struct original_hub *hub, uint8_t *bytes, size_t size, vtime now)
{
    const size_t count = original_sender_pull(&hub->sender, bytes, size, now);
    wake_if_sent(hub, now);
    return count;
}

/* Return when original_hub_run() must be called next: when the main program continues, or at the next tick of the UART
 * driver that can move bytes. */
vtime original_hub_next_time(const struct original_hub *hub, vtime now)
{
    return vtime_min(hub->wake, original_sender_next_tick(&hub->sender, now));
}

/* Execute the interrupt of the UART driver if a tick is due; then the main program, up to the next event for which it
 * waits. */
void original_hub_run(struct original_hub *hub, vtime now)
{
    if (original_sender_next_tick(&hub->sender, now) == now) {
        original_sender_tick(&hub->sender, now);
        hub->hal.start_transmit(hub->hal.context);
        wake_if_sent(hub, now);
    }
    if (hub->state == ORIGINAL_HUB_SENDS && original_sender_is_free(&hub->sender)) {
        account_time(hub, &hub->account.blocked_time, now);
        read_next_board(hub, hub->board + 1u, now);
    }
    if (hub->state <= ORIGINAL_HUB_READS && hub->transfer_is_done) {
        hub->transfer_is_done = false;
        end_transfer(hub, now);
        wake_if_sent(hub, now);
    }
    if (hub->state == ORIGINAL_HUB_DELAYS && now >= hub->delay_end) {
        account_time(hub, &hub->account.delay_time, now);
        begin_cycle(hub, now);
    }
}

/* Return the sums of the counted cycles after the first cycle; all 0 before the end of the second cycle. */
struct original_account original_hub_measure_cycles(const struct original_hub *hub)
{
    const struct original_account *first = &hub->first_cycle, *last = &hub->last_cycle;
    if (last->cycles <= first->cycles || !first->cycles) {
        return (struct original_account){.cycles = 0};
    }
    return (struct original_account){
        .call_time = last->call_time - first->call_time,
        .read_time = last->read_time - first->read_time,
        .retry_time = last->retry_time - first->retry_time,
        .blocked_time = last->blocked_time - first->blocked_time,
        .delay_time = last->delay_time - first->delay_time,
        .wire_time = last->wire_time - first->wire_time,
        .pacing_time = last->pacing_time - first->pacing_time,
        .wire_bytes = last->wire_bytes - first->wire_bytes,
        .messages = last->messages - first->messages,
        .failed_tries = last->failed_tries - first->failed_tries,
        .cycles = last->cycles - first->cycles,
        .time = last->time - first->time,
    };
}
