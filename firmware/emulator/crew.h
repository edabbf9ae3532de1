/* Threads that share the boards' work between two events: boards meet on the bus only, so that what lies between is each one's own.
 *
 * What is worked on must be independent of its order; then results are the same to the bit, whatever the number of threads. */
#ifndef EMULATOR_CREW_H
#define EMULATOR_CREW_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define CREW_MAX 16u /* threads, the caller's among them */
#define CREW_ITEMS_MAX 1024u

typedef void (*crew_work)(void *context, size_t item);

struct crew {
    size_t helpers;
    pthread_t threads[CREW_MAX - 1u];
    _Atomic uint64_t ticket; /* which job it is, and which of its items nobody has taken yet */
    _Atomic size_t done;
    _Atomic size_t sleepers;
    _Atomic bool ends;
    crew_work work;
    void *context;
    pthread_mutex_t mutex;
    pthread_cond_t wake;
};

/* `threads` from 1 to CREW_MAX, the caller's included. Returns 0, or -1 after a line on stderr. */
int crew_open(struct crew *crew, size_t threads);
void crew_close(struct crew *crew);

/* Do `work` for items 0 to count - 1 (CREW_ITEMS_MAX at most), some of it in other threads; all is done when it returns. Not from
 * within `work`. A crew of NULL does it alone. */
void crew_share(struct crew *crew, size_t count, crew_work work, void *context);

#endif
