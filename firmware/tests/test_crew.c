/* Threads that share work: each item is done once, whoever takes it, and all of them by the end. */
#define _GNU_SOURCE
#include <time.h>

#include "check.h"
#include "emulator/crew.h"

#define ITEMS 300u

struct job {
    unsigned times[ITEMS]; /* not atomic: an item belongs to who takes it, and then to the caller */
    unsigned number;
};

static struct crew crew;

static void count(void *context, size_t item)
{
    struct job *job = context;
    job->times[item] += job->number;
}

static void check_job(struct crew *by, size_t items, unsigned number)
{
    struct job job = {.number = number};
    crew_share(by, items, count, &job);
    for (size_t i = 0; i < ITEMS; i++) {
        CHECK_EQUAL(job.times[i], i < items ? number : 0u);
    }
}

static void every_item_is_done_once(void)
{
    for (size_t threads = 1; threads <= CREW_MAX; threads = 2u * threads) {
        CHECK_EQUAL(crew_open(&crew, threads), 0);
        for (unsigned number = 1; number <= 300; number++) {
            check_job(&crew, number % ITEMS, number);
        }
        crew_close(&crew);
    }
}

struct meeting {
    _Atomic unsigned present;
    bool met[2];
};

/* Waits for the other one: they meet only if two threads are at work at once. */
static void meet(void *context, size_t item)
{
    struct meeting *meeting = context;
    const time_t end = time(NULL) + 20;
    atomic_fetch_add(&meeting->present, 1u);
    while (atomic_load(&meeting->present) < 2u && time(NULL) < end) {
    }
    meeting->met[item] = atomic_load(&meeting->present) == 2u;
}

static void items_are_done_at_the_same_time(void)
{
    struct meeting meeting = {.present = 0};
    CHECK_EQUAL(crew_open(&crew, 2), 0);
    crew_share(&crew, 2, meet, &meeting);
    CHECK(meeting.met[0] && meeting.met[1]);
    crew_close(&crew);
}

static void nobody_but_the_caller_is_needed(void)
{
    check_job(NULL, ITEMS, 1);
    check_job(NULL, 0, 2);
}

static bool all_sleep(struct crew *by)
{
    const struct timespec pause = {.tv_nsec = 200000};
    const time_t end = time(NULL) + 20;
    while (atomic_load(&by->sleepers) != by->helpers && time(NULL) < end) {
        nanosleep(&pause, NULL);
    }
    return atomic_load(&by->sleepers) == by->helpers;
}

static void helpers_that_fell_asleep_are_woken(void)
{
    CHECK_EQUAL(crew_open(&crew, 3), 0);
    for (unsigned number = 1; number <= 20; number++) {
        CHECK(all_sleep(&crew));
        check_job(&crew, 17, number);
    }
    CHECK(all_sleep(&crew));
    crew_close(&crew);
}

static void a_crew_without_work_ends(void)
{
    for (int i = 0; i < 50; i++) {
        CHECK_EQUAL(crew_open(&crew, 4), 0);
        crew_close(&crew);
    }
}

int main(void)
{
    RUN(every_item_is_done_once);
    RUN(items_are_done_at_the_same_time);
    RUN(nobody_but_the_caller_is_needed);
    RUN(helpers_that_fell_asleep_are_woken);
    RUN(a_crew_without_work_ends);
    return check_summary();
}
