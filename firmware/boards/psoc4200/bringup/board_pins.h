/* Pins of the bring-up image: those that the silicon fixes, and free pins of the kits CY8CKIT-042 and CY8CKIT-049-42xx
 * (confirm: positions on the headers). The kits have the capacitor of 2.2 nF at P4.2 and an LED at P1.6 (confirm). */
#ifndef PSOC4200_BRINGUP_BOARD_PINS_H
#define PSOC4200_BRINGUP_BOARD_PINS_H

#include "boards/psoc4/pins.h"

#define BOARD_PIN_SCL PIN(4, 0)
#define BOARD_PIN_SDA PIN(4, 1)
#define BOARD_BUS_SCB 0
#define BOARD_PIN_UART_RX PIN(0, 4)
#define BOARD_PIN_UART_TX PIN(0, 5)
#define BOARD_PIN_LED PIN(1, 6)
#define BOARD_PIN_CLOCK PIN(1, 7)
#define BOARD_PIN_TX PIN(2, 0) /* the known capacitor is between this pin */
#define BOARD_PIN_RX PIN(2, 2) /* and this one */
#define BOARD_PIN_CMOD PIN(4, 2)
#define BOARD_PIN_CINT_A PIN(3, 6)
#define BOARD_PIN_CINT_B PIN(3, 7)

#endif
