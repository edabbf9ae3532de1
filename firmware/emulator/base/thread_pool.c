#define _GNU_SOURCE
#include "emulator/base/thread_pool.h"

#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>

/* A ticket packs the number of the task (32 bits), the first item not yet started, and one past the last item not yet
 * started. */
#define END_BITS 16
#define END_MASK ((1u << END_BITS) - 1u)
#define FIRST_INCREMENT (1ull << END_BITS)
#define NUMBER_SHIFT (2 * END_BITS)
_Static_assert(THREAD_POOL_ITEMS_MAX <= END_MASK, "item numbers have END_BITS each");

#define SPINS 40000 /* about 1 ms: the next task usually starts sooner than the kernel can wake a thread */

/* Return the number of the first item that no thread has started. `ticket` packs the number of the task (upper 32
 * bits), this item and the end of the items (16 bits each). */
static size_t get_first_item(uint64_t ticket)
{
    return (size_t)(ticket >> END_BITS) & END_MASK;
}

/* Return one past the number of the last item that no thread has started: the low 16 bits of `ticket`, see
 * get_first_item(). */
static size_t get_items_end(uint64_t ticket)
{
    return (size_t)ticket & END_MASK;
}

/* Reduce the power of a busy-waiting thread for a few cycles. */
static inline void pause_cpu(void)
{
#ifdef __x86_64__
    __builtin_ia32_pause();
#endif
}

/* Run one item of the current task; returns false if no item is left. The number of the task is a part of the compared
 * ticket, so `task` and `context` cannot change before the item is done. The caller's thread takes items from the first
 * on, workers from the last: the data of an item then tend to stay in the cache of the same core from task to task. */
static bool run_next_item(struct thread_pool *pool, bool is_worker)
{
    uint64_t ticket = atomic_load(&pool->ticket);
    do {
        if (get_first_item(ticket) == get_items_end(ticket)) {
            return false;
        }
    } while (!atomic_compare_exchange_weak(&pool->ticket, &ticket, is_worker ? ticket - 1u : ticket + FIRST_INCREMENT));
    pool->task(pool->context, is_worker ? get_items_end(ticket) - 1u : get_first_item(ticket));
    atomic_fetch_add(&pool->items_done, 1u);
    return true;
}

/* Return whether a worker thread must not sleep: an item is available, or the pool is being closed. */
static bool has_work_or_is_closing(struct thread_pool *pool)
{
    const uint64_t ticket = atomic_load(&pool->ticket);
    return get_first_item(ticket) != get_items_end(ticket) || atomic_load(&pool->is_closing);
}

/* Wait until a task has items that no thread has started, or until the pool closes. The worker spins for about 1 ms
 * before it sleeps on the condition variable, because the next task usually starts sooner than the kernel can wake a
 * thread. */
static void wait_for_work(struct thread_pool *pool)
{
    for (int i = 0; i < SPINS; i++) {
        if (has_work_or_is_closing(pool)) {
            return;
        }
        pause_cpu();
    }
    pthread_mutex_lock(&pool->mutex);
    atomic_fetch_add(&pool->workers_asleep, 1u);
    while (!has_work_or_is_closing(pool)) {
        pthread_cond_wait(&pool->wake, &pool->mutex);
    }
    atomic_fetch_sub(&pool->workers_asleep, 1u);
    pthread_mutex_unlock(&pool->mutex);
}

/* Run items of tasks until the pool closes; main function of a worker thread. */
static void *run_worker(void *context)
{
    struct thread_pool *pool = context;
    while (!atomic_load(&pool->is_closing)) {
        if (!run_next_item(pool, true)) {
            wait_for_work(pool);
        }
    }
    return NULL;
}

/* Wake the worker threads that sleep, if there are any. */
static void wake_workers(struct thread_pool *pool)
{
    if (atomic_load(&pool->workers_asleep)) {
        pthread_mutex_lock(&pool->mutex);
        pthread_cond_broadcast(&pool->wake);
        pthread_mutex_unlock(&pool->mutex);
    }
}

/* Start `threads` - 1 workers; the caller's thread is the remaining one. Workers block all signals: a signal delivered
 * to a worker would not interrupt a system call in which the caller waits. Returns 0, or -1 after an error line on
 * stderr. */
int thread_pool_open(struct thread_pool *pool, size_t threads)
{
    sigset_t all, before;
    memset(pool, 0, sizeof *pool);
    sigfillset(&all);
    pthread_mutex_init(&pool->mutex, NULL);
    pthread_cond_init(&pool->wake, NULL);
    pthread_sigmask(SIG_BLOCK, &all, &before);
    while (pool->worker_count + 1u < threads &&
           !pthread_create(&pool->workers[pool->worker_count], NULL, run_worker, pool)) {
        pool->worker_count++;
    }
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (pool->worker_count + 1u < threads) {
        fprintf(stderr, "threads: expected %zu, only %zu could be started; request fewer threads\n", threads,
                pool->worker_count + 1u);
        thread_pool_close(pool);
        return -1;
    }
    return 0;
}

/* Stop and join all workers. No task may be running. */
void thread_pool_close(struct thread_pool *pool)
{
    atomic_store(&pool->is_closing, true);
    wake_workers(pool);
    for (size_t i = 0; i < pool->worker_count; i++) {
        pthread_join(pool->workers[i], NULL);
    }
    pthread_cond_destroy(&pool->wake);
    pthread_mutex_destroy(&pool->mutex);
}

/* Wait until all `count` items of a task are done. The caller has no item left to start, but workers still run their
 * last items. */
static void wait_for_last_items(struct thread_pool *pool, size_t count)
{
    for (int spins = 0; atomic_load(&pool->items_done) != count;) {
        if (spins < SPINS) {
            spins++;
            pause_cpu();
        } else {
            sched_yield(); /* a worker may be waiting for this core */
        }
    }
}

/* Run `task` for items 0 to count - 1 on all threads and return when every item is done. The caller's thread runs items
 * too; without workers it runs them all. */
void thread_pool_run(struct thread_pool *pool, size_t count, thread_pool_task task, void *context)
{
    if (!pool || pool->worker_count == 0) {
        for (size_t i = 0; i < count; i++) {
            task(context, i);
        }
        return;
    }
    const uint64_t number = (atomic_load(&pool->ticket) >> NUMBER_SHIFT) + 1u;
    pool->task = task;
    pool->context = context;
    atomic_store(&pool->items_done, 0u);
    atomic_store(&pool->ticket, number << NUMBER_SHIFT | count);
    wake_workers(pool);
    while (run_next_item(pool, false)) {
    }
    wait_for_last_items(pool, count);
}
