#ifndef TAXEL_TERMINATION_H
#define TAXEL_TERMINATION_H

/*
 * End of a process after a signal that its interpreter cannot handle.
 *
 * Python runs a signal handler only between two instructions. A library that holds the interpreter's lock and never
 * returns therefore prevents the end of the process. This handler runs at once: it starts a timer, whose signal SIGALRM
 * ends the process, and then calls the handler that was installed before.
 */

/*
 * Wrap the present handler of `number`. seconds: time until SIGALRM. Returns 0, or -1 if the handler cannot be
 * replaced. Only one signal at a time can be wrapped.
 */
int termination_watch(int number, unsigned int seconds);

/* Stop the timer, and install the handler that was wrapped, unless another one has been installed since. */
void termination_unwatch(void);

#endif
