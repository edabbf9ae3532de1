#include "termination.h"

#include <signal.h>
#include <stddef.h>
#include <unistd.h>

static struct sigaction wrapped;
static volatile sig_atomic_t watched;
static volatile sig_atomic_t grace_seconds;

static void start_timer(int number)
{
    (void)alarm((unsigned int)grace_seconds); /* async-signal-safe (POSIX.1-2017, 2.4.3) */
    if (wrapped.sa_handler != SIG_DFL && wrapped.sa_handler != SIG_IGN) {
        wrapped.sa_handler(number);
    }
}

int termination_watch(int number, unsigned int seconds)
{
    struct sigaction own;
    if (watched != 0 || sigaction(number, NULL, &wrapped) != 0 || (wrapped.sa_flags & SA_SIGINFO) != 0) {
        return -1;
    }
    grace_seconds = (sig_atomic_t)seconds;
    own = wrapped;
    own.sa_handler = start_timer;
    if (sigaction(number, &own, NULL) != 0) {
        return -1;
    }
    watched = number;
    return 0;
}

void termination_unwatch(void)
{
    struct sigaction present;
    (void)alarm(0);
    if (watched != 0 && sigaction(watched, NULL, &present) == 0 && present.sa_handler == start_timer) {
        (void)sigaction(watched, &wrapped, NULL);
    }
    watched = 0;
}
