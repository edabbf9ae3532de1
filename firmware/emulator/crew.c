#define _GNU_SOURCE
#include "emulator/crew.h"

#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>

/* A ticket: the job's number, the first item that nobody has taken, and the one after the last. */
#define END_BITS 16
#define END_MASK ((1u << END_BITS) - 1u)
#define FIRST (1ull << END_BITS)
#define NUMBER_SHIFT (2 * END_BITS)
_Static_assert(CREW_ITEMS_MAX <= END_MASK, "items have END_BITS each");

static size_t first_of(uint64_t ticket)
{
    return (size_t)(ticket >> END_BITS) & END_MASK;
}

static size_t end_of(uint64_t ticket)
{
    return (size_t)ticket & END_MASK;
}

#define SPINS 40000 /* a ms or some: jobs follow each other faster than the kernel wakes a thread */

static inline void relax(void)
{
#ifdef __x86_64__
    __builtin_ia32_pause();
#endif
}

/* One item of whatever job there is. Taking it by the job's own number keeps the job, and so `work`, in place until it is done. The
 * caller begins with the first, helpers with the last: what an item works on stays in the cache of the core that had it before. */
static bool take(struct crew *crew, bool helps)
{
    uint64_t ticket = atomic_load(&crew->ticket);
    do {
        if (first_of(ticket) == end_of(ticket)) {
            return false;
        }
    } while (!atomic_compare_exchange_weak(&crew->ticket, &ticket, helps ? ticket - 1u : ticket + FIRST));
    crew->work(crew->context, helps ? end_of(ticket) - 1u : first_of(ticket));
    atomic_fetch_add(&crew->done, 1u);
    return true;
}

static bool is_called(struct crew *crew)
{
    const uint64_t ticket = atomic_load(&crew->ticket);
    return first_of(ticket) != end_of(ticket) || atomic_load(&crew->ends);
}

static void wait_for_work(struct crew *crew)
{
    for (int i = 0; i < SPINS; i++) {
        if (is_called(crew)) {
            return;
        }
        relax();
    }
    pthread_mutex_lock(&crew->mutex);
    atomic_fetch_add(&crew->sleepers, 1u);
    while (!is_called(crew)) {
        pthread_cond_wait(&crew->wake, &crew->mutex);
    }
    atomic_fetch_sub(&crew->sleepers, 1u);
    pthread_mutex_unlock(&crew->mutex);
}

static void *help(void *context)
{
    struct crew *crew = context;
    while (!atomic_load(&crew->ends)) {
        if (!take(crew, true)) {
            wait_for_work(crew);
        }
    }
    return NULL;
}

static void wake_sleepers(struct crew *crew)
{
    if (atomic_load(&crew->sleepers)) {
        pthread_mutex_lock(&crew->mutex);
        pthread_cond_broadcast(&crew->wake);
        pthread_mutex_unlock(&crew->mutex);
    }
}

/* Signals are the caller's: one that came to a helper would not interrupt what the caller waits in. */
int crew_open(struct crew *crew, size_t threads)
{
    sigset_t all, before;
    memset(crew, 0, sizeof *crew);
    sigfillset(&all);
    pthread_mutex_init(&crew->mutex, NULL);
    pthread_cond_init(&crew->wake, NULL);
    pthread_sigmask(SIG_BLOCK, &all, &before);
    while (crew->helpers + 1u < threads && !pthread_create(&crew->threads[crew->helpers], NULL, help, crew)) {
        crew->helpers++;
    }
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (crew->helpers + 1u < threads) {
        fprintf(stderr, "threads: no more than %zu can be started\n", crew->helpers + 1u);
        crew_close(crew);
        return -1;
    }
    return 0;
}

void crew_close(struct crew *crew)
{
    atomic_store(&crew->ends, true);
    wake_sleepers(crew);
    for (size_t i = 0; i < crew->helpers; i++) {
        pthread_join(crew->threads[i], NULL);
    }
    pthread_cond_destroy(&crew->wake);
    pthread_mutex_destroy(&crew->mutex);
}

void crew_share(struct crew *crew, size_t count, crew_work work, void *context)
{
    if (!crew || crew->helpers == 0) {
        for (size_t i = 0; i < count; i++) {
            work(context, i);
        }
        return;
    }
    const uint64_t number = (atomic_load(&crew->ticket) >> NUMBER_SHIFT) + 1u;
    crew->work = work;
    crew->context = context;
    atomic_store(&crew->done, 0u);
    atomic_store(&crew->ticket, number << NUMBER_SHIFT | count);
    wake_sleepers(crew);
    while (take(crew, false)) {
    }
    for (int spins = 0; atomic_load(&crew->done) != count;) { /* the others are at their last items */
        if (spins < SPINS) {
            spins++;
            relax();
        } else {
            sched_yield(); /* one of them waits for this core */
        }
    }
}
