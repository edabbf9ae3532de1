#include "boards/psoc4200/bringup/bus_test.h"

#include "boards/psoc4200/bringup/cycles.h"
#include "boards/psoc4200/bringup/text.h"
#include "boards/psoc4/bus_pins.h"
#include "part/peri_clk.h"
#include "boards/psoc4/regs/scb.h"

#define FIRST_ADDRESS 0x08u
#define LAST_ADDRESS 0x77u
#define LINE_SETTLES (CYCLES_PER_MS / 50u)
#define TIMEOUT (2u * CYCLES_PER_MS)
#define CLOCK_DIVIDER 4u /* 12 MHz */
#define MASTER (SCB_I2C_CTRL_MASTER | SCB_I2C_CTRL_HIGH_PHASE(14u) | SCB_I2C_CTRL_LOW_PHASE(16u))
#define ENDED (SCB_INTR_I2C_ACK | SCB_INTR_I2C_NACK | SCB_INTR_I2C_ARB_LOST | SCB_INTR_I2C_BUS_ERROR)

/* Release (1) or drive low (0) both lines of the bus, and return their levels after they have settled: bit 0 SCL, bit 1
 * SDA. */
static uint32_t drive(uint32_t scl, uint32_t sda)
{
    bus_pins_drive(scl, sda);
    for (uint32_t begin = cycles_now(); cycles_since(begin) < LINE_SETTLES;) {
    }
    return BUS_PORT->state & (BUS_SCL | BUS_SDA);
}

/* Wait for one of these interrupt causes of the I2C master. Returns the causes that occurred; 0 if none occurred within
 * 2 ms. */
static uint32_t wait_for(uint32_t causes)
{
    for (uint32_t begin = cycles_now(); cycles_since(begin) < TIMEOUT;) {
        if (SCB0->intr_m & causes) {
            return SCB0->intr_m & causes;
        }
    }
    return 0;
}

/* Enable the serial block as I2C master, with an empty FIFO and without pending causes. */
static void enable(void)
{
    SCB0->ctrl = 0;
    SCB0->tx_fifo_ctrl = SCB_FIFO_CTRL_CLEAR;
    SCB0->tx_fifo_ctrl = 0;
    SCB0->intr_m = SCB_INTR_ALL;
    SCB0->ctrl = SCB_CTRL_MODE_I2C | SCB_CTRL_ENABLED;
}

/* Send an address for writing, then a stop condition. Returns the interrupt causes with which the address ended (ACK,
 * NACK, lost arbitration or bus error; 0 after a timeout). */
static uint32_t probe(uint8_t address)
{
    enable();
    SCB0->tx_fifo_wr = (uint32_t)address << 1;
    SCB0->i2c_m_cmd = SCB_I2C_M_CMD_START_ON_IDLE;
    const uint32_t causes = wait_for(ENDED);
    if (causes & (SCB_INTR_I2C_ACK | SCB_INTR_I2C_NACK)) {
        SCB0->i2c_m_cmd = SCB_I2C_M_CMD_STOP;
        (void)wait_for(SCB_INTR_I2C_STOP);
    }
    return causes;
}

/* Test the I2C bus and print one line of results. `idle`, `scl_low`, `sda_low`: levels of the lines (bit 0 SCL, bit 1
 * SDA) when both are released, when SCL is driven low, and when SDA is driven low. If both released lines are high,
 * each address is probed: numbers of addresses with ACK, with NACK, and with neither (timeout, lost arbitration or bus
 * error), and the first address with ACK. */
void bus_test_run(void)
{
    uint32_t acknowledged = 0, refused = 0, failed = 0, first = 0;
    bus_pins_release();
    bus_pins_connect(PIN_GPIO);
    const uint32_t idle = drive(1, 1), scl_low = drive(0, 1), sda_low = drive(1, 0);
    bus_pins_release();
    PERI_CLK->divider_a[0] = (CLOCK_DIVIDER - 1u) | PERI_CLK_DIVIDER_ENABLE;
    PERI_CLK->select[PERI_CLK_OF_SCB0] = PERI_CLK_SELECT_A(0u);
    SCB0->ctrl = 0;
    SCB0->i2c_ctrl = MASTER;
    SCB0->tx_ctrl = SCB_DATA_WIDTH(8u) | SCB_MSB_FIRST;
    SCB0->rx_ctrl = SCB_DATA_WIDTH(8u) | SCB_MSB_FIRST | SCB_RX_CTRL_MEDIAN;
    bus_pins_connect(PIN_I2C);
    for (uint8_t address = FIRST_ADDRESS; idle == (BUS_SCL | BUS_SDA) && address <= LAST_ADDRESS; address++) {
        const uint32_t causes = probe(address);
        acknowledged += causes & SCB_INTR_I2C_ACK ? 1u : 0u;
        first = causes & SCB_INTR_I2C_ACK && !first ? address : first;
        refused += causes & SCB_INTR_I2C_NACK ? 1u : 0u;
        failed += causes & (SCB_INTR_I2C_ACK | SCB_INTR_I2C_NACK) ? 0u : 1u;
    }
    SCB0->ctrl = 0;
    bus_pins_disconnect();
    text_put("bus");
    text_number("idle", idle);
    text_number("scl_low", scl_low);
    text_number("sda_low", sda_low);
    text_number("acks", acknowledged);
    text_number("nacks", refused);
    text_number("failed", failed);
    text_number("first", first);
    text_end_line();
}
