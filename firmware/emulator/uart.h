/* The hub's UART and the USB adapter behind it, in virtual time.
 *
 * A byte takes 10 bit times. The adapter sends a USB packet to the host when 62 bytes are complete or its latency timer
 * has expired, and deasserts CTS while its buffer is full. When the hub deasserts RTS, the adapter still sends the
 * characters that its transmitter has already taken; then its buffer fills, and the host has to wait. */
#ifndef EMULATOR_UART_H
#define EMULATOR_UART_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "emulator/endpoint.h"
#include "emulator/uart_faults.h"
#include "emulator/base/vtime.h"
#include "emulator/world_file/world_file.h"
#include "hub/hub.h"

#define UART_FIFO_SIZE 8u
#define USB_PACKET_SIZE 62u /* payload of a 64-byte full-speed packet of the usual adapters */
#define USB_BUFFER_SIZE 4096u
#define UART_RECEIVE_BUFFER_SIZE 8192u
/* estimate: the character in the shift register and the next ones in the transmitter's FIFO */
#define UART_BYTES_AFTER_HOLD 3u

/* The program on the hub's side of the UART: firmware or bootloader. */
struct uart_user {
    void *context;
    void (*on_byte)(void *context, uint8_t byte);
    /* copies up to `size` bytes to transmit; returns their number */
    size_t (*pull)(void *context, uint8_t *bytes, size_t size);
};

struct uart {
    struct uart_user user;
    struct endpoint *endpoint;
    vtime byte_time;
    vtime usb_latency;

    /* hub to host */
    vtime transmit_next; /* when the transmit FIFO is refilled; VTIME_NEVER: idle or blocked */
    bool is_blocked;     /* by CTS */
    bool lacks_cts;      /* CTS is not wired: bytes that find the adapter full are lost */
    uint64_t bytes_lost; /* in a full adapter */
    uint8_t packet[USB_BUFFER_SIZE];
    size_t packet_fill;
    vtime packet_deadline;
    uint64_t bytes_sent; /* put onto the wire by the hub */

    /* host to hub */
    uint8_t receive[UART_RECEIVE_BUFFER_SIZE];
    /* when each byte is in the adapter; 0: as soon as the host has sent it */
    vtime receive_ready[UART_RECEIVE_BUFFER_SIZE];
    size_t receive_head, receive_tail;
    vtime receive_next; /* when the next byte reaches the hub; VTIME_NEVER: nothing to send, or held */
    vtime usb_latency_to_hub;
    bool is_held; /* by RTS */
    unsigned sent_while_held;

    struct uart_faults to_host_faults, to_hub_faults;
    struct fault_log *log;
};

void uart_init(struct uart *uart, struct endpoint *endpoint, const struct world_description *world,
               struct fault_log *log);

/* Start the hub's transmitter, unless it runs or is blocked, because the hub has bytes to transmit. */
void uart_start_transmit(struct uart *uart, vtime now);

/* Stop the hub's transmitter, because the hub has lost its power. */
void uart_stop_transmit(struct uart *uart);

/* Refill the transmit FIFO from the hub, at the time `transmit_next`. Returns the number of bytes taken. */
size_t uart_refill_transmitter(struct uart *uart);

/* Send the bytes in the adapter's buffer to the host. */
void uart_flush_packet(struct uart *uart, vtime now);

/* Send bytes from the host at `now`. Returns the number of bytes for which the buffer has space. */
size_t uart_send_from_host(struct uart *uart, const uint8_t *bytes, size_t size, vtime now);
size_t uart_host_free_space(const struct uart *uart);

/* Set the hub's RTS: deasserted, so that the adapter pauses (true), or asserted (false). */
void uart_set_hold(struct uart *uart, bool hold, vtime now);

/* Deliver one byte to the hub's receiver, at the time `receive_next`. The byte is lost if the hub has no power. */
void uart_deliver_to_hub(struct uart *uart, bool hub_is_powered);

#endif
