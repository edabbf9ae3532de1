#include "emulator/hub_original.h"

#include <stdlib.h>

/* Start an I2C transfer on the emulated bus; HAL function of the original hub. */
static void on_start_transfer(void *context, const struct taxel_i2c_transfer *transfer)
{
    struct hub_node *node = context;
    bus_start_transfer(node->bus, BUS_HUB, transfer, node->now);
}

/* Start the UART's transmitter; HAL function of the original hub. */
static void on_start_transmit(void *context)
{
    struct hub_node *node = context;
    uart_start_transmit(node->uart, node->now);
}

/* Ignore a byte from the host; callback of the emulated UART. */
static void on_uart_byte(void *context, uint8_t byte)
{
    (void)context; /* the original hub takes no commands */
    (void)byte;
}

/* Copy the next bytes to send from the hub's UART driver; callback of the emulated UART. Returns their number. */
static size_t pull_uart_bytes(void *context, uint8_t *bytes, size_t size)
{
    struct hub_node *node = context;
    node->now = vtime_max(node->now, node->uart->transmit_next);
    return original_hub_pull(node->original, bytes, size, node->now);
}

/* Create the original firmware of the hub. Returns 0, or -1 after an error line on stderr. */
int hub_original_open(struct hub_node *node, const struct world_description *world)
{
    const struct original_hub_hal hal = {
        .context = node, .start_transfer = on_start_transfer, .start_transmit = on_start_transmit};
    node->original = malloc(sizeof *node->original);
    if (!node->original) {
        fprintf(stderr, "hub: out of memory for the original firmware\n");
        return -1;
    }
    original_hub_init(node->original, &world->original, &hal, world->baud, node->clock_rate);
    return 0;
}

/* Free the original firmware of the hub; does nothing for other hubs. */
void hub_original_close(struct hub_node *node)
{
    free(node->original);
    node->original = NULL;
}

/* Reset the hub at virtual time `now`. */
void hub_original_boot(struct hub_node *node, vtime now)
{
    node->program = PROGRAM_APPLICATION;
    node->booted = node->now = node->cpu_free = now;
    node->uart->user = (struct uart_user){.context = node, .on_byte = on_uart_byte, .pull = pull_uart_bytes};
    original_hub_reset(node->original, now);
}

/* Report the end of a transfer to the hub's firmware. */
void hub_original_on_i2c_done(struct hub_node *node, vtime now)
{
    node->now = vtime_max(node->now, now);
    original_hub_on_transfer_done(node->original, node->bus->result, now);
}

/* Return when the hub's firmware must run next; VTIME_NEVER without power or work. */
vtime hub_original_next_time(const struct hub_node *node)
{
    const vtime next = node->is_powered ? original_hub_next_time(node->original, node->now) : VTIME_NEVER;
    return next == VTIME_NEVER ? VTIME_NEVER : vtime_max(next, node->cpu_free);
}

/* Run the hub's firmware once at virtual time `now`. */
void hub_original_run(struct hub_node *node, vtime now)
{
    node->now = vtime_max(node->now, now);
    original_hub_run(node->original, node->now);
}

/* Convert a virtual time to seconds. */
static double to_seconds(vtime time)
{
    return (double)time / (double)VTIME_SECOND;
}

/* Write the sums of the hub's poll cycles (numbers of cycles, messages, failed tries and bytes; times in seconds) as
 * the member `original` of a JSON object, followed by a comma. */
void hub_original_write_statistics(const struct hub_node *node, FILE *file)
{
    const struct original_account account = original_hub_measure_cycles(node->original);
    fprintf(file, "  \"original\": {\n    \"cycles\": %llu, \"messages\": %llu, \"failed_tries\": %llu,\n",
            (unsigned long long)account.cycles, (unsigned long long)account.messages,
            (unsigned long long)account.failed_tries);
    fprintf(file, "    \"wire_bytes\": %llu, \"seconds\": %.9f,\n", (unsigned long long)account.wire_bytes,
            to_seconds(account.time));
    fprintf(file, "    \"call_s\": %.9f, \"read_s\": %.9f, \"retry_s\": %.9f,\n", to_seconds(account.call_time),
            to_seconds(account.read_time), to_seconds(account.retry_time));
    fprintf(file, "    \"blocked_s\": %.9f, \"delay_s\": %.9f,\n", to_seconds(account.blocked_time),
            to_seconds(account.delay_time));
    fprintf(file, "    \"wire_s\": %.9f, \"pacing_s\": %.9f\n  },\n", to_seconds(account.wire_time),
            to_seconds(account.pacing_time));
}
