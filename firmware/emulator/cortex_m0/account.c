/* What handlers cost, from the first cycle of their entry to the last of their return. */
#include "emulator/cortex_m0/parts.h"

void cortex_m0_set_account(struct cortex_m0 *cpu, struct cortex_m0_account *account)
{
    cpu->account = account;
    if (account) {
        *account = (struct cortex_m0_account){0};
    }
}

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

static void add(uint64_t cycles, bool first, uint64_t *sum, uint64_t *least, uint64_t *most)
{
    *sum += cycles;
    *least = first || cycles < *least ? cycles : *least;
    *most = cycles > *most ? cycles : *most;
}

void cortex_m0_account_end(struct cortex_m0 *cpu, unsigned number, uint64_t end)
{
    struct cortex_m0_account *const account = cpu->account;
    if (!account || !account->depth || account->open[account->depth - 1u].number != number) {
        return; /* it began before the account did */
    }
    account->depth--;
    const uint64_t inclusive = end - account->open[account->depth].begin;
    struct cortex_m0_cost *const cost = &account->cost[number];
    add(inclusive, !cost->count, &cost->inclusive, &cost->inclusive_min, &cost->inclusive_max);
    add(inclusive - account->open[account->depth].inner, !cost->count, &cost->own, &cost->own_min, &cost->own_max);
    cost->count++;
    if (account->depth) {
        account->open[account->depth - 1u].inner += inclusive;
    }
}
