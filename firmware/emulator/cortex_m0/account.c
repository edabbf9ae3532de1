/* Cycle accounting of handlers, from the first cycle of the entry to the last cycle of the return. */
#include "emulator/cortex_m0/internal.h"

/* Start to count the cycles of each exception handler in `account`, which is cleared; NULL ends the counting. */
void cortex_m0_set_account(struct cortex_m0 *cpu, struct cortex_m0_account *account)
{
    cpu->account = account;
    if (account) {
        *account = (struct cortex_m0_account){0};
    }
}

/* Record the entry into the handler of exception `number` at cycle `begin`: its latency since the exception became
 * pending, and a new level of nesting. */
void cortex_m0_account_begin(struct cortex_m0 *cpu, unsigned number, uint64_t begin)
{
    struct cortex_m0_account *const account = cpu->account;
    if (!account || account->depth >= CORTEX_M0_EXCEPTIONS) {
        return;
    }
    struct cortex_m0_cost *const cost = &account->cost[number];
    const uint64_t latency = begin > cpu->pended_at[number] ? begin - cpu->pended_at[number] : 0;
    cost->latency += latency;
    cost->latency_max = latency > cost->latency_max ? latency : cost->latency_max;
    account->open[account->depth].number = (uint8_t)number;
    account->open[account->depth].begin = begin;
    account->open[account->depth].inner = 0;
    account->depth++;
    account->depth_max = account->depth > account->depth_max ? account->depth : account->depth_max;
}

/* Add one execution of a handler, which took `cycles`, to the sum, minimum and maximum of its cycles. first: this is
 * the first execution, so the old minimum is not valid. */
static void add_cost(uint64_t cycles, bool first, uint64_t *sum, uint64_t *minimum, uint64_t *maximum)
{
    *sum += cycles;
    *minimum = first || cycles < *minimum ? cycles : *minimum;
    *maximum = cycles > *maximum ? cycles : *maximum;
}

/* Record the end of the handler of exception `number` at cycle `end`. Inclusive cycles contain the handlers that
 * preempted it, exclusive cycles do not. */
void cortex_m0_account_end(struct cortex_m0 *cpu, unsigned number, uint64_t end)
{
    struct cortex_m0_account *const account = cpu->account;
    if (!account || !account->depth || account->open[account->depth - 1u].number != number) {
        return; /* the handler was entered before accounting started */
    }
    account->depth--;
    const uint64_t inclusive = end - account->open[account->depth].begin;
    struct cortex_m0_cost *const cost = &account->cost[number];
    add_cost(inclusive, !cost->count, &cost->inclusive, &cost->inclusive_min, &cost->inclusive_max);
    const uint64_t exclusive = inclusive - account->open[account->depth].inner;
    add_cost(exclusive, !cost->count, &cost->exclusive, &cost->exclusive_min, &cost->exclusive_max);
    cost->count++;
    if (account->depth) {
        account->open[account->depth - 1u].inner += inclusive;
    }
}
