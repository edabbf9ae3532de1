/* Threads that share the items of one task: advance all boards, or compute the load on every board.
 *
 * Between two events, boards do not affect each other, so that the boards are independent items. Items of a task must
 * not depend on the order in which they run; then results are identical to the bit for every number of threads. */
#ifndef EMULATOR_BASE_THREAD_POOL_H
#define EMULATOR_BASE_THREAD_POOL_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define THREAD_POOL_THREADS_MAX 16u /* includes the caller's thread */
#define THREAD_POOL_ITEMS_MAX 1024u

typedef void (*thread_pool_task)(void *context, size_t item);

struct thread_pool {
    size_t worker_count;
    pthread_t workers[THREAD_POOL_THREADS_MAX - 1u];
    _Atomic uint64_t ticket; /* number of the current task and range of its items that no thread has started */
    _Atomic size_t items_done;
    _Atomic size_t workers_asleep;
    _Atomic bool is_closing;
    thread_pool_task task;
    void *context;
    pthread_mutex_t mutex;
    pthread_cond_t wake;
};

/* Start `threads` - 1 workers; `threads` is 1 to THREAD_POOL_THREADS_MAX and includes the caller's thread.
 * Returns 0, or -1 after an error line on stderr. */
int thread_pool_open(struct thread_pool *pool, size_t threads);

/* Stop and join all workers. No task may be running. */
void thread_pool_close(struct thread_pool *pool);

/* Run `task` once for each item 0 to count - 1 (count <= THREAD_POOL_ITEMS_MAX) in the caller's thread and the workers;
 * returns when every item is done. A task must not call this function. With `pool` NULL, the caller's thread runs all
 * items. */
void thread_pool_run(struct thread_pool *pool, size_t count, thread_pool_task task, void *context);

#endif
