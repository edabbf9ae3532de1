#include "emulator/uart.h"

#include <string.h>

#define BITS_PER_BYTE 10.0 /* 8N1 */
#define USB_FRAME (1u * VTIME_MS) /* of full speed: the least that the host's bytes take */

void uart_init(struct uart *uart, struct endpoint *endpoint, const struct world_description *world, struct fault_log *log)
{
    memset(uart, 0, sizeof *uart);
    uart->endpoint = endpoint;
    uart->log = log;
    uart->byte_time = (vtime)(BITS_PER_BYTE / world->baud * (double)VTIME_SECOND);
    uart->usb_latency = (vtime)(world->usb_latency_ms * (double)VTIME_MS);
    uart->usb_latency_down = (vtime)(world->usb_latency_down_ms * (double)VTIME_MS);
    uart->transmit_next = uart->packet_deadline = uart->receive_next = VTIME_NEVER;
}

void uart_kick(struct uart *uart, vtime now)
{
    if (uart->transmit_next == VTIME_NEVER && !uart->held_back) {
        uart->transmit_next = now;
    }
}

void uart_hub_is_gone(struct uart *uart)
{
    uart->transmit_next = VTIME_NEVER;
    uart->held_back = false;
}

void uart_flush_packet(struct uart *uart, vtime now)
{
    if (now < uart->up.held_until) {
        uart->packet_deadline = uart->up.held_until;
        return;
    }
    const size_t sent = endpoint_send(uart->endpoint, uart->packet, uart->packet_fill, now);
    uart->packet_fill -= sent;
    memmove(uart->packet, uart->packet + sent, uart->packet_fill);
    uart->packet_deadline = uart->packet_fill ? now + VTIME_MS : VTIME_NEVER;
    if (uart->held_back && uart->packet_fill + 2u * UART_FIFO <= USB_BUFFER) {
        uart->held_back = false;
        uart->transmit_next = now;
    }
}

static void to_adapter(struct uart *uart, uint8_t sent, vtime arrival)
{
    uint8_t bytes[2];
    const size_t size = line_faults_pass(&uart->up, sent, bytes, arrival, uart->log);
    for (size_t i = 0; i < size; i++) {
        if (uart->packet_fill == 0) {
            uart->packet_deadline = vtime_max(arrival + uart->usb_latency, uart->up.held_until);
        }
        uart->packet[uart->packet_fill++] = bytes[i];
        if (uart->packet_fill % USB_PACKET == 0) {
            uart_flush_packet(uart, arrival);
        }
    }
}

size_t uart_transmit(struct uart *uart)
{
    uint8_t bytes[UART_FIFO];
    const vtime now = uart->transmit_next;
    if (uart->packet_fill + 2u * UART_FIFO > USB_BUFFER) {
        uart->held_back = true;
        uart->transmit_next = VTIME_NEVER;
        return 0;
    }
    const size_t size = uart->user.pull(uart->user.context, bytes, sizeof bytes);
    for (size_t i = 0; i < size; i++) {
        to_adapter(uart, bytes[i], now + (i + 1u) * uart->byte_time);
    }
    uart->bytes_sent += size;
    uart->transmit_next = size ? now + size * uart->byte_time : VTIME_NEVER;
    return size;
}

size_t uart_host_room(const struct uart *uart)
{
    return UART_RECEIVE_BUFFER - (uart->receive_head - uart->receive_tail);
}

static bool is_held(const struct uart *uart)
{
    return uart->holds && uart->sent_while_held >= UART_SENT_AFTER_HOLD;
}

/* The adapter's next byte begins at `start`, or when it has come from the host. */
static void send_next(struct uart *uart, vtime start)
{
    const vtime ready = uart->receive_ready[uart->receive_tail % UART_RECEIVE_BUFFER];
    const bool is_empty = uart->receive_tail == uart->receive_head;
    uart->receive_next = is_empty || is_held(uart) ? VTIME_NEVER : vtime_max(start, ready) + uart->byte_time;
}

size_t uart_host_sends(struct uart *uart, const uint8_t *bytes, size_t size, vtime now)
{
    size_t taken = 0;
    while (taken < size && uart_host_room(uart)) {
        const size_t place = uart->receive_head++ % UART_RECEIVE_BUFFER;
        uart->receive[place] = bytes[taken++];
        uart->receive_ready[place] = uart->usb_latency_down > USB_FRAME ? now + uart->usb_latency_down : 0;
    }
    if (taken && uart->receive_next == VTIME_NEVER && !is_held(uart)) {
        send_next(uart, vtime_max(now, uart->down.held_until) + uart->usb_latency_down);
    }
    return taken;
}

void uart_hold(struct uart *uart, bool hold, vtime now)
{
    const bool was_held = is_held(uart);
    uart->holds = hold;
    uart->sent_while_held = 0;
    if (was_held && !hold) {
        send_next(uart, vtime_max(now, uart->down.held_until));
    }
}

void uart_receive(struct uart *uart, bool hub_is_powered)
{
    uint8_t bytes[2];
    const vtime now = uart->receive_next;
    const uint8_t sent = uart->receive[uart->receive_tail++ % UART_RECEIVE_BUFFER];
    const size_t size = line_faults_pass(&uart->down, sent, bytes, now, uart->log);
    uart->sent_while_held += uart->holds;
    for (size_t i = 0; i < size && hub_is_powered; i++) {
        uart->user.on_byte(uart->user.context, bytes[i]);
    }
    send_next(uart, vtime_max(now, uart->down.held_until));
}
