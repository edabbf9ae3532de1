/* What the firmware costs on a 48 MHz Cortex-M0, in CPU cycles. Estimates from counting instructions of the C sources; to be
 * replaced by counts from the executed Cortex-M0 images. */
#ifndef EMULATOR_COSTS_H
#define EMULATOR_COSTS_H

#define CPU_HZ 48000000.0

#define COST_CONVERSION_INTERRUPT 220u /* store a count, its CRC, find the next crossing, start it */
#define COST_SLAVE_ADDRESS 160u        /* address interrupt: latch, choose a source; the clock is stretched meanwhile */
#define COST_SLAVE_BYTE 55u            /* one byte into or out of the slave's FIFO */
#define COST_SLAVE_STOP 70u

#define COST_MASTER_BYTE 50u     /* one byte into or out of the master's FIFO */
#define COST_MASTER_DONE 120u    /* end-of-transfer interrupt */
#define COST_HUB_PASS 280u       /* one pass of the main loop up to the start of the next transfer */
#define COST_HUB_CHECK_BYTE 22u  /* CRC of a snapshot, a byte */
#define COST_HUB_ENCODE_BYTE 62u /* CRC, whitening and stuffing, a byte */
#define COST_UART_INTERRUPT 60u  /* refill the transmit FIFO */
#define COST_UART_BYTE 14u

#endif
