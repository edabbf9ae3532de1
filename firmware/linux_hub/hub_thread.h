/* A linux_hub on an I2C adapter in real time: a thread runs its main loop. C interface of the Python package.
 *
 * Integration:
 *
 *     struct hub_thread *thread = hub_thread_start(fd, &settings);    // fd: open adapter, e.g. /dev/i2c-1
 *     poll hub_thread_fd(thread) for reading;
 *     size = hub_thread_receive(thread, bytes, sizeof bytes);
 *     hub_thread_stop(thread);    // the caller closes fd */
#ifndef LINUX_HUB_HUB_THREAD_H
#define LINUX_HUB_HUB_THREAD_H

#include "linux_hub/linux_hub.h"

struct hub_thread;

/* Start a hub on the open adapter `fd`, which must stay open until hub_thread_stop(). Returns NULL with errno if thread
 * or memory cannot be created. */
struct hub_thread *hub_thread_start(int fd, const struct linux_hub_settings *settings);
/* Wait for the end of the transfer in progress, stop the thread and release the memory. */
void hub_thread_stop(struct hub_thread *thread);

/* Return a file descriptor that is readable while bytes wait, and after the end of the thread. */
int hub_thread_fd(const struct hub_thread *thread);
/* Take up to `size` bytes for the host; returns their number. */
size_t hub_thread_receive(struct hub_thread *thread, uint8_t *bytes, size_t size);
/* Append bytes of the host; returns the number of bytes that fitted into the buffer. */
size_t hub_thread_send(struct hub_thread *thread, const uint8_t *bytes, size_t size);
/* Return the error number with which the adapter has failed, after which the thread has ended; 0 while it runs. */
int hub_thread_failure(struct hub_thread *thread);

#endif
