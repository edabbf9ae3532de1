/* Cost of the firmware on a 48 MHz Cortex-M0 in CPU cycles, counted in the executed images by
 * `python tools/firmware/calibrate_costs.py`, which writes this file. docs/firmware-cycles.md defines each figure. */
#ifndef EMULATOR_BASE_COSTS_H
#define EMULATOR_BASE_COSTS_H

#define CPU_HZ 48000000.0

#define COST_CONVERSION 534u
#define COST_SETTLE_LOOP 4u
#define COST_QUOTIENT {0, 4, 46, 50, 46, 50, 44, 48, 46, 50, 44, 48, 44, 50, 50, 50}
#define COST_NEW_TX 143u
#define COST_SKIPPED_CROSSING 23u
#define COST_SCAN 638u
#define COST_AFTER_START 76u
#define COST_AFTER_SCAN 15u
#define COST_SENSOR_INIT 19555u

#define COST_TICK 39u
#define COST_TICK_PERIOD 196608u
#define COST_TAIL_CHAIN 22u

#define COST_SLAVE_WRITE 235u
#define COST_SLAVE_WRITE_HOLD 164u
#define COST_SLAVE_READ 557u
#define COST_SLAVE_READ_HOLD 489u
#define COST_SLAVE_BYTE 163u
#define COST_SLAVE_BYTE_HOLD 107u
#define COST_SLAVE_REFILL 250u
#define COST_SLAVE_STOP 137u
#define COST_SLAVE_FIFO 8u

#define COST_COMPACT 2076u
#define COST_COMPACT_TAXEL 444u

#define COST_MASTER_DONE 141u
#define COST_MASTER_BYTE 49u
#define COST_HUB_PASS 1438u
#define COST_HUB_FRAME_BYTE 87u
#define COST_UART_INTERRUPT 137u
#define COST_UART_BYTE 46u

#endif
