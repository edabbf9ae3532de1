/* A processor with 4 KiB of flash at 0, 1 KiB of RAM at 0x20000000 and a few registers at 0x40000000, for programs of a few
 * halfwords. */
#ifndef TEST_CORTEX_M0_BENCH_H
#define TEST_CORTEX_M0_BENCH_H

#include "emulator/cortex_m0/cortex_m0.h"

#define BENCH_FLASH 4096u
#define BENCH_RAM 1024u
#define BENCH_RAM_BASE 0x20000000u
#define BENCH_STACK (BENCH_RAM_BASE + BENCH_RAM)
#define BENCH_MAIN 0x100u          /* where the program begins */
#define BENCH_HANDLER(number) (0x200u + 0x20u * (number))
#define BENCH_PORT 0x40000000u
#define BENCH_SCRATCH (BENCH_RAM_BASE + 0x80u) /* where bench_access() puts its instruction */
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
    uint32_t port[8];             /* the registers, four bytes apart */
    enum cortex_m0_answer answer; /* to the next accesses */
    uint32_t stall;
    bool stops;                   /* from the callback */
    int raises;                   /* that interrupt's line, with the access; -1: none */
    struct bench_access accesses[BENCH_ACCESSES];
    unsigned count;
};

/* Without wait states; the handlers are empty (BX LR). Change `config` and call bench_reset() for something else. */
void bench_init(struct bench *bench);
void bench_reset(struct bench *bench);
void bench_put(struct bench *bench, uint32_t address, const uint16_t *halves, unsigned count);
void bench_word(struct bench *bench, uint32_t address, uint32_t value);
uint32_t bench_read(const struct bench *bench, uint32_t address); /* a word of flash or RAM */
/* Steps until the program counter is there; the cycles that took. 0 after a thousand steps. */
uint64_t bench_until(struct bench *bench, uint32_t address);


/* One instruction of the program, out of line, with r0 = value and r1 = address; r0 afterwards. It goes on where it was. */
uint32_t bench_access(struct bench *bench, uint16_t instruction, uint32_t address, uint32_t value);
uint32_t bench_load(struct bench *bench, uint32_t address);
void bench_store(struct bench *bench, uint32_t address, uint32_t value);

#define BENCH_PUT(bench, address, ...) \
    do { \
        const uint16_t halves_[] = {__VA_ARGS__}; \
        bench_put((bench), (address), halves_, sizeof halves_ / sizeof *halves_); \
    } while (0)

/* NOPs from BENCH_MAIN on. */
void bench_nops(struct bench *bench);

/* The program from BENCH_MAIN on, and a reset. */
#define BENCH_PROGRAM(bench, ...) \
    do { \
        BENCH_PUT((bench), BENCH_MAIN, __VA_ARGS__); \
        bench_reset(bench); \
    } while (0)

#endif
