/* Test of the I2C bus: levels of the lines, and an address to every device. */
#ifndef PSOC4200_BRINGUP_BUS_TEST_H
#define PSOC4200_BRINGUP_BUS_TEST_H

/* Print the line "bus ..." (docs/bring-up.md). */
void bus_test_run(void);

#endif
