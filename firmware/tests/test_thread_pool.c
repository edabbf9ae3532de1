/* The thread pool: each item of a task runs exactly once, items run concurrently, and sleeping workers are woken. */
#define _GNU_SOURCE
#include <time.h>

#include "check.h"
#include "emulator/base/thread_pool.h"

#define ITEMS 300u
#define TIMEOUT_S 20

struct sums {
    unsigned of_item[ITEMS]; /* not atomic: the thread sanitizer then reports an item that runs in two threads */
    unsigned increment;
};

static struct thread_pool pool;

/* Add the increment to the sum of its item; task of the thread pool. */
static void add_increment(void *context, size_t item)
{
    struct sums *sums = context;
    sums->of_item[item] += sums->increment;
}

/* Check that a task runs exactly once for each of the items. */
static void check_each_item_runs_once(struct thread_pool *threads, size_t items, unsigned increment)
{
    struct sums sums = {.increment = increment};
    thread_pool_run(threads, items, add_increment, &sums);
    for (size_t i = 0; i < ITEMS; i++) {
        CHECK_EQUAL(sums.of_item[i], i < items ? increment : 0u);
    }
}

static void each_item_runs_once_for_every_thread_count(void)
{
    for (size_t threads = 1; threads <= THREAD_POOL_THREADS_MAX; threads = 2u * threads) {
        CHECK_EQUAL(thread_pool_open(&pool, threads), 0);
        for (unsigned number = 1; number <= 300; number++) {
            check_each_item_runs_once(&pool, number % ITEMS, number);
        }
        thread_pool_close(&pool);
    }
}

struct rendezvous {
    _Atomic unsigned arrived;
    bool has_met[2];
};

/* Wait until both items of the task run, which is possible only if two threads work at the same time; task of the
 * thread pool. */
static void wait_for_other_item(void *context, size_t item)
{
    struct rendezvous *rendezvous = context;
    const time_t end = time(NULL) + TIMEOUT_S;
    atomic_fetch_add(&rendezvous->arrived, 1u);
    while (atomic_load(&rendezvous->arrived) < 2u && time(NULL) < end) {
    }
    rendezvous->has_met[item] = atomic_load(&rendezvous->arrived) == 2u;
}

static void two_threads_run_items_at_the_same_time(void)
{
    struct rendezvous rendezvous = {.arrived = 0};
    CHECK_EQUAL(thread_pool_open(&pool, 2), 0);
    thread_pool_run(&pool, 2, wait_for_other_item, &rendezvous);
    CHECK(rendezvous.has_met[0] && rendezvous.has_met[1]);
    thread_pool_close(&pool);
}

static void without_a_pool_the_caller_runs_all_items(void)
{
    check_each_item_runs_once(NULL, ITEMS, 1);
    check_each_item_runs_once(NULL, 0, 2);
}

/* Wait until all worker threads sleep. Returns false if this takes too long. */
static bool wait_until_all_workers_sleep(struct thread_pool *threads)
{
    const struct timespec pause = {.tv_nsec = 200000};
    const time_t end = time(NULL) + TIMEOUT_S;
    while (atomic_load(&threads->workers_asleep) != threads->worker_count && time(NULL) < end) {
        nanosleep(&pause, NULL);
    }
    return atomic_load(&threads->workers_asleep) == threads->worker_count;
}

static void sleeping_workers_are_woken_for_a_task(void)
{
    CHECK_EQUAL(thread_pool_open(&pool, 3), 0);
    for (unsigned number = 1; number <= 20; number++) {
        CHECK(wait_until_all_workers_sleep(&pool));
        check_each_item_runs_once(&pool, 17, number);
    }
    CHECK(wait_until_all_workers_sleep(&pool));
    thread_pool_close(&pool);
}

static void a_pool_without_work_can_be_closed(void)
{
    for (int i = 0; i < 50; i++) {
        CHECK_EQUAL(thread_pool_open(&pool, 4), 0);
        thread_pool_close(&pool);
    }
}

int main(void)
{
    RUN(each_item_runs_once_for_every_thread_count);
    RUN(two_threads_run_items_at_the_same_time);
    RUN(without_a_pool_the_caller_runs_all_items);
    RUN(sleeping_workers_are_woken_for_a_task);
    RUN(a_pool_without_work_can_be_closed);
    return check_summary();
}
