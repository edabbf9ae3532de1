/* What the firmware costs on a 48 MHz Cortex-M0, in CPU cycles: counted in the executed images by
 * `python tools/firmware/calibrate_costs.py`, which writes this file. docs/firmware-cycles.md says what each is. */
#ifndef EMULATOR_COSTS_H
#define EMULATOR_COSTS_H

#define CPU_HZ 48000000.0

#define COST_CONVERSION 538u
#define COST_SETTLE_LOOP 4u
#define COST_QUOTIENT {0, 4, 46, 50, 46, 50, 44, 48, 46, 50, 44, 48, 44, 50, 50, 50}
#define COST_NEW_TX 143u
#define COST_SKIPPED_CROSSING 23u
#define COST_SCAN 633u
#define COST_AFTER_START 76u
#define COST_AFTER_SCAN 13u
#define COST_SENSOR_INIT 18795u

#define COST_TICK 39u
#define COST_TICK_PERIOD 196608u
#define COST_TAIL_CHAIN 22u

#define COST_SLAVE_WRITE 228u
#define COST_SLAVE_WRITE_HOLD 151u
#define COST_SLAVE_READ 514u
#define COST_SLAVE_READ_HOLD 447u
#define COST_SLAVE_BYTE 152u
#define COST_SLAVE_BYTE_HOLD 99u
#define COST_SLAVE_REFILL 247u
#define COST_SLAVE_STOP 128u
#define COST_SLAVE_FIFO 8u

#define COST_COMPACT 2000u
#define COST_COMPACT_TAXEL 600u

#define COST_MASTER_DONE 108u
#define COST_MASTER_BYTE 108u
#define COST_HUB_PASS 866u
#define COST_HUB_FRAME_BYTE 155u
#define COST_UART_INTERRUPT 118u
#define COST_UART_BYTE 48u

#endif
