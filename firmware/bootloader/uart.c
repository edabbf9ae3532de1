/* Packets over a UART: a packet's end follows from its length field; a silent line discards an incomplete packet. */
#include <stdatomic.h>

#include "bootloader/internal.h"

#define SIZE_TOO_LONG (TAXEL_BOOT_PACKET_MAX + 1u)

/* Initialise the UART connection `uart` of the bootloader `boot`: no byte has been received. */
void taxel_boot_uart_init(struct taxel_boot_uart *uart, struct taxel_boot *boot)
{
    memset(uart, 0, sizeof *uart);
    uart->boot = boot;
}

/* Store a byte of a packet (UART interrupt). A packet ends at the length stated in its header; after a silence longer
 * than TAXEL_BOOT_GAP_US a new packet begins. Bytes are ignored while a packet waits for the main loop, before a start
 * byte, and after a packet with an impossible length. */
void taxel_boot_uart_on_byte(struct taxel_boot_uart *uart, uint8_t byte)
{
    const struct taxel_boot_hal *const hal = uart->boot->config->flash.hal;
    const uint32_t now_us = hal->clock_us(hal->context);
    const bool was_silent = now_us - uart->last_byte_us > TAXEL_BOOT_GAP_US;
    uart->last_byte_us = now_us;
    if (uart->has_packet) {
        return;
    }
    if (was_silent) {
        uart->received = 0;
        uart->skipping = false;
    }
    if (uart->skipping || (uart->received == 0 && byte != TAXEL_BOOT_PACKET_START)) {
        return;
    }
    uart->packet[uart->received++] = byte;
    if (uart->received < TAXEL_BOOT_DATA_OFFSET) {
        return;
    }
    const unsigned size = taxel_get_u16(uart->packet + 2) + TAXEL_BOOT_PACKET_OVERHEAD;
    if (size > TAXEL_BOOT_PACKET_MAX) {
        uart->received = SIZE_TOO_LONG; /* answered with LENGTH; the other bytes are ignored */
        uart->skipping = true;
    }
    uart->has_packet = uart->received >= size || uart->skipping;
}

/* Copy up to `size` bytes of the response to `bytes` (UART interrupt); returns their number. */
size_t taxel_boot_uart_pull(struct taxel_boot_uart *uart, uint8_t *bytes, size_t size)
{
    size_t taken = 0;
    while (taken < size && uart->position < uart->response_size) {
        bytes[taken++] = uart->response[uart->position++];
    }
    return taken;
}

/* Run one pass of the main loop: execute a received packet and queue its response for the UART interrupt, then run the
 * bootloader, which may start an image. */
void taxel_boot_uart_run(struct taxel_boot_uart *uart)
{
    if (uart->has_packet) {
        const size_t size = taxel_boot_take_packet(uart->boot, uart->packet, uart->received, uart->response);
        uart->position = 0;
        uart->response_size = (uint8_t)size;
        uart->received = 0;
        atomic_signal_fence(memory_order_release);
        uart->has_packet = false; /* from here on the buffer belongs to the interrupt */
    }
    taxel_boot_run(uart->boot);
}
