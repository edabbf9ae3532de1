/* The UART driver of the original hub: a ring of 128 bytes, a FIFO of 8 bytes, and an interrupt at 2 kHz. Arguments:
 * SEED ROUNDS. */
#include <stdlib.h>

#include "check.h"
#include "emulator/base/random.h"
#include "emulator/original/original_sender.h"

#define RECEIVED_MAX 100000u

static struct original_sender sender;
static uint8_t received[RECEIVED_MAX];
static size_t received_size;
static vtime now, wire_free;

/* Start a UART driver with an empty ring at virtual time 0. `is_paced`: the interrupt at 2 kHz fills the FIFO. */
static void open_sender(bool is_paced, uint16_t ring_size, double baud)
{
    struct original_settings settings;
    original_settings_set_defaults(&settings);
    settings.is_paced = is_paced;
    settings.ring_size = ring_size;
    original_sender_init(&sender, &settings, baud, 1.0);
    original_sender_reset(&sender, 0);
    now = wire_free = 0;
    received_size = 0;
}

/* Execute interrupts and the wire up to `until`, like the port: the wire takes bytes whenever it is free. */
static void run(vtime until)
{
    for (;;) {
        const vtime tick = original_sender_next_tick(&sender, now);
        const bool has_bytes = sender.is_paced ? sender.fifo_fill > 0 : original_sender_has_bytes(&sender);
        const vtime pull = has_bytes ? vtime_max(now, wire_free) : VTIME_NEVER;
        if (vtime_min(tick, pull) > until) {
            break;
        }
        now = vtime_min(tick, pull);
        if (pull <= tick) {
            received_size += original_sender_pull(&sender, received + received_size, ORIGINAL_FIFO_SIZE, now);
            wire_free = sender.wire_end;
        } else {
            original_sender_tick(&sender, now);
        }
    }
    now = until;
}

/* Put a message of `size` bytes into the ring. */
static void send_message(size_t size)
{
    static uint8_t message[1024];
    for (size_t i = 0; i < size; i++) {
        message[i] = (uint8_t)(i * 7u);
    }
    original_sender_put(&sender, message, size, now);
}

/* Return the time in ms until a message of `size` bytes is on the wire completely. */
static double measure_time_ms(size_t size)
{
    send_message(size);
    run(VTIME_SECOND);
    CHECK_EQUAL(received_size, size);
    return (double)sender.wire_end / (double)VTIME_MS;
}

static void at_115200_baud_the_driver_sends_eight_bytes_per_millisecond(void)
{
    open_sender(true, 128, 115200.0);
    CHECK_BETWEEN(measure_time_ms(800), 99.6, 99.8); /* 99 ms and the wire time of the last 8 bytes */
    CHECK_BETWEEN(sender.pacing_time, 30.2 * VTIME_MS, 30.3 * VTIME_MS); /* 99 pauses of 0.306 ms */
}

static void at_250000_baud_the_driver_sends_eight_bytes_per_half_millisecond(void)
{
    open_sender(true, 128, 250000.0);
    CHECK_BETWEEN(measure_time_ms(800), 49.5, 50.0);
}

/* At 155 kbaud the FIFO is empty at most ticks, while its last byte is still in the shift register: the driver sends
 * 8 bytes at 7 of 8 ticks. If it waited for the wire, it would send them at every second tick, in 99.5 ms. */
static void the_interrupt_refills_the_fifo_while_the_last_byte_is_sent(void)
{
    open_sender(true, 128, 155000.0);
    CHECK_BETWEEN(measure_time_ms(800), 58.0, 61.0);
}

static void without_pacing_the_wire_has_no_pauses(void)
{
    open_sender(false, 128, 115200.0);
    CHECK_BETWEEN(measure_time_ms(800), 69.43, 69.45); /* 8000 bits */
    CHECK_EQUAL(sender.pacing_time, 0);
}

static void a_message_longer_than_the_ring_blocks_the_main_program(void)
{
    open_sender(false, 128, 115200.0);
    send_message(250);
    CHECK(!original_sender_is_free(&sender));
    run(10 * VTIME_MS); /* 120 bytes taken: two bytes are still outside of the ring */
    CHECK(!original_sender_is_free(&sender));
    run(12 * VTIME_MS);
    CHECK(original_sender_is_free(&sender));
}

static void a_message_that_fits_into_the_ring_does_not_block(void)
{
    open_sender(true, 256, 115200.0);
    send_message(250);
    CHECK(original_sender_is_free(&sender));
}

static void a_reset_discards_the_ring(void)
{
    open_sender(true, 128, 115200.0);
    send_message(100);
    original_sender_reset(&sender, now);
    run(VTIME_SECOND);
    CHECK_EQUAL(received_size, 0);
}

/* Return a random integer from 0 to `limit` - 1. */
static unsigned random_below(struct random_source *random, unsigned limit)
{
    return (unsigned)(random_u64(random) % limit);
}

/* Send messages of random sizes at random times, with or without pacing. Check that each byte arrives once, in
 * order. */
static void check_random_messages(uint64_t seed)
{
    static uint8_t sent[RECEIVED_MAX];
    struct random_source random;
    size_t sent_size = 0;
    random_init(&random, seed, 0);
    open_sender(random_below(&random, 2), (uint16_t)(16u + random_below(&random, 300)),
                1e3 * (double)(20u + random_below(&random, 400)));
    while (sent_size + 300u < RECEIVED_MAX / 10u) {
        const size_t size = 1u + random_below(&random, 255);
        for (size_t i = 0; i < size; i++) {
            sent[sent_size + i] = (uint8_t)random_below(&random, 256);
        }
        original_sender_put(&sender, sent + sent_size, size, now);
        sent_size += size;
        do {
            run(now + random_below(&random, 20) * VTIME_MS);
        } while (!original_sender_is_free(&sender));
    }
    run(now + 10 * VTIME_SECOND);
    if (!CHECK_EQUAL(received_size, sent_size) || !CHECK_BYTES(received, sent, sent_size) ||
        !CHECK_EQUAL(sender.bytes, sent_size)) {
        printf("  replay: test_original_sender %llu 1\n", (unsigned long long)seed);
    }
}

static uint64_t first_seed = 1;
static unsigned long rounds = 50;

static void every_byte_of_random_messages_arrives_once_in_order(void)
{
    for (unsigned long i = 0; i < rounds; i++) {
        check_random_messages(first_seed + i);
    }
}

int main(int argc, char **argv)
{
    first_seed = argc > 1 ? strtoull(argv[1], NULL, 10) : first_seed;
    rounds = argc > 2 ? strtoul(argv[2], NULL, 10) : rounds;
    printf("seed %llu\n", (unsigned long long)first_seed);
    RUN(at_115200_baud_the_driver_sends_eight_bytes_per_millisecond);
    RUN(at_250000_baud_the_driver_sends_eight_bytes_per_half_millisecond);
    RUN(the_interrupt_refills_the_fifo_while_the_last_byte_is_sent);
    RUN(without_pacing_the_wire_has_no_pauses);
    RUN(a_message_longer_than_the_ring_blocks_the_main_program);
    RUN(a_message_that_fits_into_the_ring_does_not_block);
    RUN(a_reset_discards_the_ring);
    RUN(every_byte_of_random_messages_arrives_once_in_order);
    return check_summary();
}
