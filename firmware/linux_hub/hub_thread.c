#include "linux_hub/hub_thread.h"

#include <errno.h>
#include <pthread.h>
#include <stdlib.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

#include "linux_hub/i2c_dev.h"

/* Longest sleep: the thread looks at the clock again, so that an unlimited wait needs no special case. */
#define LONGEST_SLEEP_US 1000000u

struct hub_thread {
    struct linux_hub *hub;
    struct i2c_dev device;
    pthread_t thread;
    pthread_mutex_t lock; /* of the hub's bytes, and of the members below */
    pthread_cond_t changed;
    int event_fd;
    bool is_stopping;
    int failure;
};

/* Make the event readable, which wakes the host. */
static void signal_host(const struct hub_thread *thread)
{
    const uint64_t one = 1;
    const ssize_t written = write(thread->event_fd, &one, sizeof one);
    (void)written; /* fails only if the event is readable already */
}

/* Sleep until the hub's next pass is due, bytes of the host arrive, or the thread is stopped. The lock is held. */
static void sleep_until(struct hub_thread *thread, uint64_t due_us)
{
    const uint64_t now_us = i2c_dev_clock_us(NULL);
    const uint64_t limit_us = now_us + LONGEST_SLEEP_US;
    if (due_us <= now_us || thread->is_stopping || linux_hub_unread(thread->hub)) {
        return;
    }
    const uint64_t until_us = due_us < limit_us ? due_us : limit_us;
    const struct timespec until = {.tv_sec = (time_t)(until_us / 1000000u),
                                   .tv_nsec = (long)(until_us % 1000000u) * 1000l};
    (void)pthread_cond_timedwait(&thread->changed, &thread->lock, &until);
}

/* Run the hub's main loop until the thread is stopped or the adapter fails (function of the thread; returns NULL). The
 * lock is released during transfers, so that the host never waits for the bus. */
static void *run(void *context)
{
    struct hub_thread *thread = context;
    (void)pthread_mutex_lock(&thread->lock);
    while (!thread->is_stopping && !thread->device.failure) {
        const uint64_t due_us = linux_hub_pass(thread->hub);
        if (linux_hub_waiting(thread->hub)) {
            signal_host(thread);
        }
        (void)pthread_mutex_unlock(&thread->lock);
        linux_hub_execute(thread->hub);
        (void)pthread_mutex_lock(&thread->lock);
        sleep_until(thread, due_us);
    }
    thread->failure = thread->device.failure;
    signal_host(thread);
    (void)pthread_mutex_unlock(&thread->lock);
    return NULL;
}

/* Create lock and condition variable, whose time limits use the monotonic clock. Returns 0 or an error number. */
static int create_lock(struct hub_thread *thread)
{
    pthread_condattr_t attributes;
    int error = pthread_condattr_init(&attributes);
    if (error) {
        return error;
    }
    (void)pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    error = pthread_cond_init(&thread->changed, &attributes);
    (void)pthread_condattr_destroy(&attributes);
    if (error) {
        return error;
    }
    error = pthread_mutex_init(&thread->lock, NULL);
    if (error) {
        (void)pthread_cond_destroy(&thread->changed);
    }
    return error;
}

/* Destroy lock and condition variable. */
static void destroy_lock(struct hub_thread *thread)
{
    (void)pthread_cond_destroy(&thread->changed);
    (void)pthread_mutex_destroy(&thread->lock);
}

/* Close the event, and release the memory of the hub and of `thread`. The thread must have ended, or not have
 * started. */
static void destroy(struct hub_thread *thread)
{
    if (thread->event_fd >= 0) {
        (void)close(thread->event_fd);
    }
    linux_hub_free(thread->hub);
    free(thread);
}

/* Start a hub on the open adapter `fd`. Returns NULL with errno on an error. */
struct hub_thread *hub_thread_start(int fd, const struct linux_hub_settings *settings)
{
    struct hub_thread *thread = calloc(1, sizeof *thread);
    if (!thread) {
        return NULL;
    }
    i2c_dev_init(&thread->device, fd, settings->scl_hz);
    const struct linux_hub_bus bus = {
        .context = &thread->device, .transfer = i2c_dev_transfer, .clock_us = i2c_dev_clock_us};
    thread->hub = linux_hub_create(settings, &bus);
    thread->event_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    int error = !thread->hub || thread->event_fd < 0 ? errno : create_lock(thread);
    if (!error) {
        error = pthread_create(&thread->thread, NULL, run, thread);
        if (error) {
            destroy_lock(thread);
        }
    }
    if (error) {
        i2c_dev_release(&thread->device);
        destroy(thread);
        errno = error;
        return NULL;
    }
    return thread;
}

/* Stop the thread after the transfer in progress, and release the memory. */
void hub_thread_stop(struct hub_thread *thread)
{
    (void)pthread_mutex_lock(&thread->lock);
    thread->is_stopping = true;
    (void)pthread_cond_signal(&thread->changed);
    (void)pthread_mutex_unlock(&thread->lock);
    (void)pthread_join(thread->thread, NULL);
    i2c_dev_release(&thread->device);
    destroy_lock(thread);
    destroy(thread);
}

/* Return a file descriptor that is readable while bytes or a failure wait. */
int hub_thread_fd(const struct hub_thread *thread)
{
    return thread->event_fd;
}

/* Take up to `size` bytes for the host. Returns their number; the event stays readable while bytes or a failure
 * wait. */
size_t hub_thread_receive(struct hub_thread *thread, uint8_t *bytes, size_t size)
{
    uint64_t count;
    (void)pthread_mutex_lock(&thread->lock);
    const size_t received = linux_hub_receive(thread->hub, bytes, size);
    const ssize_t cleared = read(thread->event_fd, &count, sizeof count);
    (void)cleared; /* fails only if the event is not readable */
    if (linux_hub_waiting(thread->hub) || thread->failure) {
        signal_host(thread);
    }
    (void)pthread_mutex_unlock(&thread->lock);
    return received;
}

/* Append bytes of the host. Returns the number of bytes that fitted into the buffer. */
size_t hub_thread_send(struct hub_thread *thread, const uint8_t *bytes, size_t size)
{
    (void)pthread_mutex_lock(&thread->lock);
    const size_t sent = linux_hub_send(thread->hub, bytes, size);
    (void)pthread_cond_signal(&thread->changed);
    (void)pthread_mutex_unlock(&thread->lock);
    return sent;
}

/* Return the error number with which the adapter has failed, after which the thread has ended; 0 while it runs. */
int hub_thread_failure(struct hub_thread *thread)
{
    (void)pthread_mutex_lock(&thread->lock);
    const int failure = thread->failure;
    (void)pthread_mutex_unlock(&thread->lock);
    return failure;
}
