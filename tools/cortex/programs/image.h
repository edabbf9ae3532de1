/* What a program on the bare processor has of its host: words and text through semihosting (BKPT 0xAB), an end. */
#ifndef CORTEX_IMAGE_H
#define CORTEX_IMAGE_H

#include <stddef.h>
#include <stdint.h>

int main(void);

void put_text(const char *text);
void put_word(const char *name, uint32_t value); /* one line: name, hexadecimal */
void end(void) __attribute__((noreturn));

typedef void handler(void);

/* Weak: a program defines those that it wants. Any other exception prints its number and ends. */
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
