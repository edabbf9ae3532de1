/* Calls into the supervisory ROM (SROM) that write flash. Parameters lie in RAM, their address goes into SYSARG.
 * Source: PSoC 4100/4200 Architecture TRM (001-85634), "Nonvolatile Memory Programming"; opcodes and keys as in
 * public programmers for this family. */
#ifndef PSOC4_REGS_SROM_H
#define PSOC4_REGS_SROM_H

#define SROM_OPCODE_LOAD_LATCH 0x04u  /* bytes into the page latch */
#define SROM_OPCODE_WRITE_ROW 0x05u   /* erase the row, then program it from the latch */
#define SROM_OPCODE_PROGRAM_ROW 0x06u /* program without erasing: bits are only set */

#define SROM_KEY_1 0xB6u
#define SROM_KEY_2(opcode) (0xD3u + (opcode))
/* First word of the parameters: keys; bits 16 to 31 are the row, or for LOAD_LATCH the byte in the latch (16 to 23) and
 * the flash macro (24 to 31), 0 on this part. */
#define SROM_PARAMETERS(opcode, high) (((uint32_t)(high) << 16) | (SROM_KEY_2(opcode) << 8) | SROM_KEY_1)

#define SROM_STATUS_SHIFT 28u
#define SROM_STATUS_OK 0xAu /* in SYSARG's high four bits, when the call has ended */

#endif
