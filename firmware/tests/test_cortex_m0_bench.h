/* Test bench for short programs: a processor with 4 KiB of flash at 0, 1 KiB of RAM at 0x20000000 and eight registers
 * at 0x40000000. */
#ifndef TEST_CORTEX_M0_BENCH_H
#define TEST_CORTEX_M0_BENCH_H

#include "emulator/cortex_m0/cortex_m0.h"

#define BENCH_FLASH 4096u
#define BENCH_RAM 1024u
#define BENCH_RAM_BASE 0x20000000u
#define BENCH_STACK (BENCH_RAM_BASE + BENCH_RAM)
#define BENCH_MAIN 0x100u /* address of the program */
#define BENCH_HANDLER(number) (0x200u + 0x20u * (number))
#define BENCH_PORT 0x40000000u
#define BENCH_SCRATCH (BENCH_RAM_BASE + 0x80u) /* address of the instruction that bench_access() executes */
#define BENCH_ACCESSES 32u

struct bench_access {
    struct cortex_m0_access access;
    bool write;
};

struct bench {
    struct cortex_m0 cpu;
    struct cortex_m0_config config;
    _Alignas(4) uint8_t flash[BENCH_FLASH];
    _Alignas(4) uint8_t ram[BENCH_RAM];
    uint32_t port[8];                 /* the eight 32-bit registers at BENCH_PORT */
    enum cortex_m0_bus_status status; /* status that the callback returns */
    uint32_t stall;
    bool stops; /* the callback calls cortex_m0_stop() */
    int raises; /* interrupt whose line the callback raises; -1: none */
    struct bench_access accesses[BENCH_ACCESSES];
    unsigned count;
};

/* Initialise a processor without wait states and with empty handlers (BX LR). For another configuration change `config`
 * and call bench_reset(). */
void bench_init(struct bench *bench);
void bench_reset(struct bench *bench);
void bench_put(struct bench *bench, uint32_t address, const uint16_t *halfwords, unsigned count);
void bench_word(struct bench *bench, uint32_t address, uint32_t value);
uint32_t bench_read(const struct bench *bench, uint32_t address); /* a word of flash or RAM */
/* Step until the program counter reaches `address`. Returns the elapsed cycles, or 0 after a thousand steps. */
uint64_t bench_run_to(struct bench *bench, uint32_t address);

/* Execute one instruction outside the program with r0 = value and r1 = address, and return r0. The program counter is
 * restored afterwards. */
uint32_t bench_access(struct bench *bench, uint16_t instruction, uint32_t address, uint32_t value);
uint32_t bench_load(struct bench *bench, uint32_t address);
void bench_store(struct bench *bench, uint32_t address, uint32_t value);

#define BENCH_PUT(bench, address, ...) \
    do { \
        const uint16_t halves_[] = {__VA_ARGS__}; \
        bench_put((bench), (address), halves_, sizeof halves_ / sizeof *halves_); \
    } while (0)

/* Initialise the processor, and fill the program with NOPs. */
void bench_nops(struct bench *bench);

/* Write the program to BENCH_MAIN and reset. */
#define BENCH_PROGRAM(bench, ...) \
    do { \
        BENCH_PUT((bench), BENCH_MAIN, __VA_ARGS__); \
        bench_reset(bench); \
    } while (0)

#endif
