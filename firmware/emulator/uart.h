/* The hub's UART and the USB adapter behind it, in virtual time: 10 bits a byte; the adapter sends a packet when 62 bytes are
 * together or its latency timer has run out, and takes no more (CTS) while its buffer is full. Asked to hold back (RTS), it
 * still sends what its transmitter has begun; then its buffer fills, and the host waits. */
#ifndef EMULATOR_UART_H
#define EMULATOR_UART_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "emulator/endpoint.h"
#include "emulator/line_faults.h"
#include "emulator/vtime.h"
#include "emulator/world_file.h"
#include "hub/hub.h"

#define UART_FIFO 8u
#define USB_PACKET 62u /* payload of a 64-byte full-speed packet of the common adapters */
#define USB_BUFFER 4096u
#define UART_RECEIVE_BUFFER 8192u
#define UART_SENT_AFTER_HOLD 3u /* estimate: the character in the shift register and those ready before it */

/* Whoever has the UART on the hub's side: its firmware, or its bootloader. */
struct uart_user {
    void *context;
    void (*on_byte)(void *context, uint8_t byte);
    size_t (*pull)(void *context, uint8_t *bytes, size_t size);
};

struct uart {
    struct uart_user user;
    struct endpoint *endpoint;
    vtime byte_time;
    vtime usb_latency;

    vtime transmit_next; /* when the transmitter has room again; VTIME_NEVER: idle or held back */
    bool held_back;      /* CTS */
    uint8_t packet[USB_BUFFER];
    size_t packet_fill;
    vtime packet_deadline;

    uint8_t receive[UART_RECEIVE_BUFFER];
    vtime receive_ready[UART_RECEIVE_BUFFER]; /* when each byte is in the adapter; 0: as soon as it was sent */
    size_t receive_head, receive_tail;
    vtime receive_next; /* VTIME_NEVER: nothing to send, or held */
    vtime usb_latency_down;
    bool holds; /* RTS */
    unsigned sent_while_held;

    uint64_t bytes_sent; /* put onto the wire by the hub */
    struct line_faults up, down; /* to the host, to the hub */
    struct fault_log *log;
};

void uart_init(struct uart *uart, struct endpoint *endpoint, const struct world_description *world, struct fault_log *log);

/* The hub has lost its power: nothing more comes from it. */
void uart_hub_is_gone(struct uart *uart);
void uart_kick(struct uart *uart, vtime now);

/* One refill of the transmit FIFO; returns the bytes it took. */
size_t uart_transmit(struct uart *uart);
void uart_flush_packet(struct uart *uart, vtime now);

/* Bytes from the host, on their way since `now`. Returns how many were taken. */
size_t uart_host_sends(struct uart *uart, const uint8_t *bytes, size_t size, vtime now);
size_t uart_host_room(const struct uart *uart);

/* The hub asks the adapter to send no more, or to go on. */
void uart_hold(struct uart *uart, bool hold, vtime now);

/* One byte reaches the hub's receiver, if there is power in it. */
void uart_receive(struct uart *uart, bool hub_is_powered);

#endif
