/* Interface of a program to its host: output of words and texts through semihosting (BKPT 0xAB), and end of the
 * program. */
#ifndef CORTEX_IMAGE_H
#define CORTEX_IMAGE_H

#include <stddef.h>
#include <stdint.h>

int main(void);

void put_text(const char *text);
void put_word(const char *name, uint32_t value); /* prints one line: name and hexadecimal value */
void end(void) __attribute__((noreturn));

typedef void handler(void);

/* Weak symbols: a program defines the handlers that it needs. Any other exception prints its number and ends the
 * program. */
void on_nmi(void);
void on_hard_fault(void);
void on_svcall(void);
void on_pendsv(void);
void on_systick(void);
void on_irq0(void);
void on_irq1(void);
void on_irq2(void);
void on_irq3(void);

#endif
