/* Cost of the firmware on a 48 MHz Cortex-M0 in CPU cycles, counted in the executed images by
 * `python tools/firmware/calibrate_costs.py`, which writes this file. docs/firmware-cycles.md defines each figure. */
#ifndef EMULATOR_BASE_COSTS_H
#define EMULATOR_BASE_COSTS_H

#define CPU_HZ 48000000.0

#define COST_CONVERSION 534u
#define COST_SETTLE_LOOP 4u
#define COST_QUOTIENT {0, 4, 46, 50, 46, 50, 44, 48, 46, 50, 44, 48, 44, 50, 50, 50}
#define COST_NEW_TX 139u
#define COST_SKIPPED_CROSSING 23u
#define COST_SCAN 638u
#define COST_AFTER_START 74u
#define COST_AFTER_SCAN 15u
#define COST_SENSOR_INIT 19600u

#define COST_TICK 39u
#define COST_TICK_PERIOD 196608u
#define COST_TAIL_CHAIN 22u

#define COST_SLAVE_WRITE 231u
#define COST_SLAVE_WRITE_HOLD 164u
#define COST_SLAVE_READ 553u
#define COST_SLAVE_READ_HOLD 489u
#define COST_SLAVE_BYTE 166u
#define COST_SLAVE_BYTE_HOLD 105u
#define COST_SLAVE_REFILL 257u
#define COST_SLAVE_STOP 137u
#define COST_SLAVE_FIFO 8u

#define COST_COMPACT 2014u
#define COST_COMPACT_TAXEL 445u

#define COST_MASTER_DONE 141u
#define COST_MASTER_BYTE 49u
#define COST_HUB_PASS 1438u
#define COST_HUB_FRAME_BYTE 87u
#define COST_UART_INTERRUPT 137u
#define COST_UART_BYTE 46u

#endif
