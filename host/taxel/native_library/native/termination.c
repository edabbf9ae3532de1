#include "termination.h"

#include <signal.h>
#include <stddef.h>
#include <unistd.h>

static struct sigaction wrapped;
static volatile sig_atomic_t watched;
static volatile sig_atomic_t grace_seconds;

/* Handler of the signal `number`: start the timer whose signal SIGALRM ends the process after `grace_seconds`, then
 * call the handler that this one replaced. */
static void start_timer(int number)
{
    (void)alarm((unsigned int)grace_seconds); /* async-signal-safe (POSIX.1-2017, 2.4.3) */
    if (wrapped.sa_handler != SIG_DFL && wrapped.sa_handler != SIG_IGN) {
        wrapped.sa_handler(number);
    }
}

/* Replace the handler of the signal `number` by start_timer(), which also calls the replaced handler. seconds: time
 * from the signal to the end of the process. Returns 0; -1 if a signal is already watched, or if the handler cannot be
 * replaced (a handler with SA_SIGINFO takes other arguments). */
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

/* Stop the timer, and install the replaced handler again, unless another handler has been installed since. */
void termination_unwatch(void)
{
    struct sigaction present;
    (void)alarm(0);
    if (watched != 0 && sigaction(watched, NULL, &present) == 0 && present.sa_handler == start_timer) {
        (void)sigaction(watched, &wrapped, NULL);
    }
    watched = 0;
}
