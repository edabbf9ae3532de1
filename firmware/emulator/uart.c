#include "emulator/uart.h"

#include <string.h>

#define BITS_PER_BYTE 10.0             /* 8N1 */
#define USB_FRAME_TIME (1u * VTIME_MS) /* of USB full speed: minimum latency of the host's bytes */
#define FLUSH_RETRY_TIME VTIME_MS

/* Initialise the UART between hub and host, with the latencies of a USB adapter. */
void uart_init(struct uart *uart, struct endpoint *endpoint, const struct world_description *world,
               struct fault_log *log)
{
    memset(uart, 0, sizeof *uart);
    uart->endpoint = endpoint;
    uart->log = log;
    uart->byte_time = (vtime)(BITS_PER_BYTE / world->baud * (double)VTIME_SECOND);
    uart->lacks_cts = world->original.is_on;
    uart->usb_latency = (vtime)(world->usb_latency_ms * (double)VTIME_MS);
    uart->usb_latency_to_hub = (vtime)(world->usb_latency_down_ms * (double)VTIME_MS);
    uart->transmit_next = uart->packet_deadline = uart->receive_next = VTIME_NEVER;
}

/* Start the hub's transmitter if it is idle, because the hub has bytes to send. */
void uart_start_transmit(struct uart *uart, vtime now)
{
    if (uart->transmit_next == VTIME_NEVER && !uart->is_blocked) {
        uart->transmit_next = now;
    }
}

/* Stop the transmission of the hub, for example because the hub has no power. */
void uart_stop_transmit(struct uart *uart)
{
    uart->transmit_next = VTIME_NEVER;
    uart->is_blocked = false;
}

/* Send the bytes that the USB adapter has collected to the host. Bytes that the host does not accept stay, and are sent
 * again later. The hub's transmitter waits until the adapter's buffer has space for twice the bytes of a FIFO, because
 * an injected fault may double each byte. */
void uart_flush_packet(struct uart *uart, vtime now)
{
    if (now < uart->to_host_faults.held_until) {
        uart->packet_deadline = uart->to_host_faults.held_until;
        return;
    }
    const size_t sent = endpoint_send(uart->endpoint, uart->packet, uart->packet_fill, now);
    uart->packet_fill -= sent;
    memmove(uart->packet, uart->packet + sent, uart->packet_fill);
    uart->packet_deadline = uart->packet_fill ? now + FLUSH_RETRY_TIME : VTIME_NEVER;
    if (uart->is_blocked && uart->packet_fill + 2u * UART_FIFO_SIZE <= USB_BUFFER_SIZE) {
        uart->is_blocked = false;
        uart->transmit_next = now;
    }
}

/* Deliver a byte from the hub to the USB adapter at its arrival time. Injected faults may change, remove or double it.
 * A packet is sent to the host when it is full or its latency has passed. */
static void transmit_to_adapter(struct uart *uart, uint8_t sent, vtime arrival)
{
    uint8_t bytes[2];
    const size_t size = uart_faults_apply(&uart->to_host_faults, sent, bytes, arrival, uart->log);
    for (size_t i = 0; i < size; i++) {
        if (uart->packet_fill == 0) {
            uart->packet_deadline = vtime_max(arrival + uart->usb_latency, uart->to_host_faults.held_until);
        }
        uart->packet[uart->packet_fill++] = bytes[i];
        if (uart->packet_fill % USB_PACKET_SIZE == 0) {
            uart_flush_packet(uart, arrival);
        }
    }
}

/* Fill the hub's transmit FIFO and send its bytes, one FIFO at a time. Returns their number. While the adapter has no
 * space, nothing is taken from the hub; without CTS, the bytes are taken and lost. */
size_t uart_refill_transmitter(struct uart *uart)
{
    uint8_t bytes[UART_FIFO_SIZE];
    const vtime now = uart->transmit_next;
    /* twice the FIFO, because an injected fault may double each byte */
    const bool is_adapter_full = uart->packet_fill + 2u * UART_FIFO_SIZE > USB_BUFFER_SIZE;
    if (is_adapter_full && !uart->lacks_cts) {
        uart->is_blocked = true;
        uart->transmit_next = VTIME_NEVER;
        return 0;
    }
    const size_t size = uart->user.pull(uart->user.context, bytes, sizeof bytes);
    for (size_t i = 0; i < size && !is_adapter_full; i++) {
        transmit_to_adapter(uart, bytes[i], now + (i + 1u) * uart->byte_time);
    }
    uart->bytes_lost += is_adapter_full ? size : 0;
    uart->bytes_sent += size;
    uart->transmit_next = size ? now + size * uart->byte_time : VTIME_NEVER;
    return size;
}

/* Return the number of bytes for which the buffer from the host to the hub has space. */
size_t uart_host_free_space(const struct uart *uart)
{
    return UART_RECEIVE_BUFFER_SIZE - (uart->receive_head - uart->receive_tail);
}

/* Return whether the hub's RTS has stopped the USB adapter. After RTS was deasserted, the adapter still sends
 * UART_BYTES_AFTER_HOLD bytes. */
static bool is_adapter_stopped(const struct uart *uart)
{
    return uart->is_held && uart->sent_while_held >= UART_BYTES_AFTER_HOLD;
}

/* Schedule the adapter's next byte to the hub: at `start`, or when it has arrived from the host. */
static void schedule_next_byte(struct uart *uart, vtime start)
{
    const vtime ready = uart->receive_ready[uart->receive_tail % UART_RECEIVE_BUFFER_SIZE];
    const bool is_empty = uart->receive_tail == uart->receive_head;
    uart->receive_next = is_empty || is_adapter_stopped(uart) ? VTIME_NEVER : vtime_max(start, ready) + uart->byte_time;
}

/* Queue bytes from the host to the hub in the USB adapter. Returns the number of accepted bytes, less than `size` if
 * the adapter's buffer is full. A latency of at most one USB frame delays only the first byte on an idle line; a longer
 * latency delays every byte. */
size_t uart_send_from_host(struct uart *uart, const uint8_t *bytes, size_t size, vtime now)
{
    size_t accepted = 0;
    while (accepted < size && uart_host_free_space(uart)) {
        const size_t slot = uart->receive_head++ % UART_RECEIVE_BUFFER_SIZE;
        uart->receive[slot] = bytes[accepted++];
        uart->receive_ready[slot] = uart->usb_latency_to_hub > USB_FRAME_TIME ? now + uart->usb_latency_to_hub : 0;
    }
    if (accepted && uart->receive_next == VTIME_NEVER && !is_adapter_stopped(uart)) {
        schedule_next_byte(uart, vtime_max(now, uart->to_hub_faults.held_until) + uart->usb_latency_to_hub);
    }
    return accepted;
}

/* Set the level of RTS from the hub: while held, the adapter sends only the bytes that its transmitter already
 * contains. */
void uart_set_hold(struct uart *uart, bool hold, vtime now)
{
    const bool was_stopped = is_adapter_stopped(uart);
    uart->is_held = hold;
    uart->sent_while_held = 0;
    if (was_stopped && !hold) {
        schedule_next_byte(uart, vtime_max(now, uart->to_hub_faults.held_until));
    }
}

/* Deliver the next byte from the adapter to the hub, with injected faults, and schedule the one after it. A hub without
 * power loses the byte. */
void uart_deliver_to_hub(struct uart *uart, bool hub_is_powered)
{
    uint8_t bytes[2];
    const vtime now = uart->receive_next;
    const uint8_t sent = uart->receive[uart->receive_tail++ % UART_RECEIVE_BUFFER_SIZE];
    const size_t size = uart_faults_apply(&uart->to_hub_faults, sent, bytes, now, uart->log);
    uart->sent_while_held += uart->is_held;
    for (size_t i = 0; i < size && hub_is_powered; i++) {
        uart->user.on_byte(uart->user.context, bytes[i]);
    }
    schedule_next_byte(uart, vtime_max(now, uart->to_hub_faults.held_until));
}
