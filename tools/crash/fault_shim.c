/* Library for LD_PRELOAD that counts the calls which change a folder, and injects one fault at a chosen call.
 *
 * The Python part loads the same library with ctypes and arms it in a child process: taxel_fault_arm. A call counts if
 * it can change a file or a name below the folder: open for writing, write, truncate, rename, link, unlink, mkdir,
 * rmdir, fsync and close of a file that is open for writing.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

enum mode {
    MODE_COUNT = 0,
    MODE_KILL = 1,       /* SIGKILL instead of the call */
    MODE_KILL_TORN = 2,  /* a part of a write, or the whole other call, then SIGKILL */
    MODE_FULL = 3,       /* a part of a write; every later call that needs space fails with ENOSPC */
    MODE_FULL_ONCE = 4,  /* one call fails with ENOSPC */
    MODE_BROKEN = 5,     /* this call and every later one fails with EIO */
    MODE_BROKEN_ONCE = 6 /* one call fails with EIO */
};

#define LARGEST_LIST 4096
#define PAGE_BYTES 4096 /* of the system's cache of files */

enum verdict { PASS, HALF, FAIL };

static char folder[PATH_MAX];
static size_t folder_length;
static atomic_long counter;
static const char *names[LARGEST_LIST];
static long fault_at;
static int fault_mode;

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

/* Arm the library: the call number `at` (from 1) below the folder `path` gets the fault `mode`. */
void taxel_fault_arm(const char *path, long at, int mode)
{
    folder_length = 0; /* no call counts while the settings change */
    snprintf(folder, sizeof folder, "%s/", path);
    fault_at = at;
    fault_mode = mode;
    atomic_store(&counter, 0);
    folder_length = strlen(folder);
}

/* Disarm the library and return the number of counted calls. */
long taxel_fault_disarm(void)
{
    folder_length = 0;
    return atomic_load(&counter);
}

/* Return the name of the counted call `number` (from 1); "" if there was no such call. */
const char *taxel_fault_name(long number)
{
    return number >= 1 && number <= LARGEST_LIST && names[number - 1] != NULL ? names[number - 1] : "";
}

/* Return whether an absolute path is below the watched folder. */
static bool is_below(const char *path)
{
    return strncmp(path, folder, folder_length) == 0;
}

/* Return whether a descriptor belongs to the watched folder or to a file below it. needs_writing: return true only for
 * a descriptor that is open for writing. */
static bool is_watched_descriptor(int descriptor, bool needs_writing)
{
    char link[64];
    char path[PATH_MAX];
    if (folder_length == 0) {
        return false;
    }
    snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    const ssize_t length = readlink(link, path, sizeof path - 2);
    if (length <= 0) {
        return false;
    }
    path[length] = '/'; /* the folder itself counts for fsync */
    path[length + 1] = '\0';
    if (!is_below(path)) {
        return false;
    }
    return !needs_writing || (fcntl(descriptor, F_GETFL) & O_ACCMODE) != O_RDONLY;
}

/* Return whether a path, relative to the open directory `directory` unless absolute, is below the watched folder. */
static bool is_watched_path(int directory, const char *path)
{
    if (folder_length == 0 || path == NULL) {
        return false;
    }
    if (path[0] == '/') {
        return is_below(path);
    }
    if (directory != AT_FDCWD) {
        return is_watched_descriptor(directory, false);
    }
    return false; /* the writers use absolute paths */
}

/* Count a call that changes the folder, and return how to execute the call: PASS (completely), HALF (only half of its
 * bytes) or FAIL (not at all; errno is set). In the mode KILL, call number `fault_at` kills the process. name: name of
 * the function. needs_space: whether the call fails on a full disk. */
static enum verdict judge(const char *name, bool needs_space)
{
    const int saved = errno;
    const long number = atomic_fetch_add(&counter, 1) + 1;
    errno = saved;
    if (number <= LARGEST_LIST) {
        names[number - 1] = name;
    }
    if (fault_mode == MODE_COUNT || number < fault_at) {
        return PASS;
    }
    if (number == fault_at) {
        switch (fault_mode) {
        case MODE_KILL:
            raise(SIGKILL);
            break;
        case MODE_KILL_TORN:
        case MODE_FULL:
            return HALF;
        case MODE_FULL_ONCE:
            errno = ENOSPC;
            return FAIL;
        default:
            errno = EIO;
            return FAIL;
        }
    }
    if (fault_mode == MODE_FULL && needs_space) {
        errno = ENOSPC;
        return FAIL;
    }
    if (fault_mode == MODE_BROKEN) {
        errno = EIO;
        return FAIL;
    }
    return PASS;
}

/* Return whether a call that writes no bytes, such as rename, must fail; errno is then set. Such a call cannot be
 * executed by half. With the verdict HALF it fails on a full disk (MODE_FULL) if it needs space; in the mode KILL_TORN
 * it is executed completely before the process is killed. */
static bool is_refused(enum verdict verdict, bool needs_space)
{
    if (verdict == FAIL) {
        return true;
    }
    if (verdict == HALF && fault_mode == MODE_FULL && needs_space) {
        errno = ENOSPC;
        return true;
    }
    return false;
}

/* Kill the process in the mode KILL_TORN after the call with the verdict HALF. */
static void end(enum verdict verdict)
{
    if (verdict == HALF && fault_mode == MODE_KILL_TORN) {
        raise(SIGKILL);
    }
}

/* Body of an interposed function that writes no bytes: execute `expression`, the original function. watched: whether
 * the call is counted. failure: value to return if a fault refuses the call. */
#define CALL(watched, needs_space, failure, expression) \
    do { \
        if (!(watched)) { \
            return (expression); \
        } \
        const enum verdict verdict_ = judge(__func__, needs_space); \
        if (is_refused(verdict_, needs_space)) { \
            return (failure); \
        } \
        const __typeof__(expression) result_ = (expression); \
        end(verdict_); \
        return result_; \
    } while (0)

/* Body of an interposed function that writes `count` bytes or parts: execute `whole`, the original function, or `half`,
 * the same with half the count. */
#define WRITE(count, whole, half) \
    do { \
        if (!is_watched_descriptor(descriptor, true)) { \
            return (whole); \
        } \
        const enum verdict verdict_ = judge(__func__, true); \
        if (verdict_ == FAIL) { \
            return -1; \
        } \
        if (verdict_ == PASS) { \
            return (whole); \
        } \
        if ((count) < 2 && fault_mode == MODE_FULL) { \
            errno = ENOSPC; \
            return -1; \
        } \
        const ssize_t result_ = (half); \
        end(verdict_); \
        return result_; \
    } while (0)

ssize_t write(int descriptor, const void *data, size_t count)
{
    WRITE(count, REAL(write)(descriptor, data, count), REAL(write)(descriptor, data, count / 2));
}

/* Return the number of bytes that an interrupted write of `count` bytes at the file position `offset` writes: about
 * half, up to a page boundary. The operating system allocates space and reacts to a kill only between two pages.
 * Returns 0 for a write within one page, which is executed completely or not at all. */
static size_t divide_at_page(size_t count, off64_t offset)
{
    const off64_t end = offset + (off64_t)count, middle = offset + (off64_t)(count / 2);
    const off64_t below = middle / PAGE_BYTES * PAGE_BYTES, boundary = below > offset ? below : below + PAGE_BYTES;
    return boundary < end ? (size_t)(boundary - offset) : 0;
}

/* Execute the first part of a write with the verdict HALF. A write within one page cannot be divided: it fails on a
 * full disk, and is executed completely if the process is then killed. */
static ssize_t write_part(int descriptor, const void *data, size_t count, off64_t offset)
{
    const size_t part = divide_at_page(count, offset);
    if (!part && fault_mode == MODE_FULL) {
        errno = ENOSPC;
        return -1;
    }
    return REAL(pwrite64)(descriptor, data, part ? part : count, offset);
}

ssize_t pwrite(int descriptor, const void *data, size_t count, off_t offset)
{
    WRITE(count, REAL(pwrite)(descriptor, data, count, offset), write_part(descriptor, data, count, offset));
}

ssize_t pwrite64(int descriptor, const void *data, size_t count, off64_t offset)
{
    WRITE(count, REAL(pwrite64)(descriptor, data, count, offset), write_part(descriptor, data, count, offset));
}

ssize_t writev(int descriptor, const struct iovec *parts, int count)
{
    WRITE(count, REAL(writev)(descriptor, parts, count), REAL(writev)(descriptor, parts, count / 2));
}

int ftruncate(int descriptor, off_t size)
{
    CALL(is_watched_descriptor(descriptor, true), true, -1, REAL(ftruncate)(descriptor, size));
}

int ftruncate64(int descriptor, off64_t size)
{
    CALL(is_watched_descriptor(descriptor, true), true, -1, REAL(ftruncate64)(descriptor, size));
}

int truncate(const char *path, off_t size)
{
    CALL(is_watched_path(AT_FDCWD, path), true, -1, REAL(truncate)(path, size));
}

int fallocate(int descriptor, int mode, off_t offset, off_t size)
{
    CALL(is_watched_descriptor(descriptor, true), true, -1, REAL(fallocate)(descriptor, mode, offset, size));
}

int fsync(int descriptor)
{
    CALL(is_watched_descriptor(descriptor, false), true, -1, REAL(fsync)(descriptor));
}

int fdatasync(int descriptor)
{
    CALL(is_watched_descriptor(descriptor, false), true, -1, REAL(fdatasync)(descriptor));
}

/* Interposed close(): a close that fails has nevertheless closed the descriptor (manual page of close). */
int close(int descriptor)
{
    if (!is_watched_descriptor(descriptor, true)) {
        return REAL(close)(descriptor);
    }
    const enum verdict verdict = judge(__func__, false);
    const int number = errno;
    const int result = REAL(close)(descriptor);
    end(verdict);
    if (verdict == FAIL) {
        errno = number;
        return -1;
    }
    return result;
}

/* Return whether opening a file with these flags can change it or create it. */
static bool is_change(int flags)
{
    return (flags & (O_CREAT | O_TRUNC)) != 0 || (flags & O_ACCMODE) != O_RDONLY;
}

/* Body of the interposed open function `name`: read the optional argument `mode`, then as CALL. */
#define OPEN(name, directory, ...) \
    do { \
        mode_t mode = 0; \
        if ((flags & (O_CREAT | O_TMPFILE)) != 0) { \
            va_list arguments; \
            va_start(arguments, flags); \
            mode = va_arg(arguments, mode_t); \
            va_end(arguments); \
        } \
        CALL(is_change(flags) && is_watched_path(directory, path), (flags & O_CREAT) != 0, -1, \
             REAL(name)(__VA_ARGS__, flags, mode)); \
    } while (0)

int open(const char *path, int flags, ...)
{
    OPEN(open, AT_FDCWD, path);
}

int open64(const char *path, int flags, ...)
{
    OPEN(open64, AT_FDCWD, path);
}

int openat(int directory, const char *path, int flags, ...)
{
    OPEN(openat, directory, directory, path);
}

int openat64(int directory, const char *path, int flags, ...)
{
    OPEN(openat64, directory, directory, path);
}

int rename(const char *old, const char *path)
{
    CALL(is_watched_path(AT_FDCWD, path), true, -1, REAL(rename)(old, path));
}

int renameat(int old_directory, const char *old, int directory, const char *path)
{
    CALL(is_watched_path(directory, path), true, -1, REAL(renameat)(old_directory, old, directory, path));
}

int renameat2(int old_directory, const char *old, int directory, const char *path, unsigned int flags)
{
    CALL(is_watched_path(directory, path), true, -1, REAL(renameat2)(old_directory, old, directory, path, flags));
}

int link(const char *old, const char *path)
{
    CALL(is_watched_path(AT_FDCWD, path), true, -1, REAL(link)(old, path));
}

int linkat(int old_directory, const char *old, int directory, const char *path, int flags)
{
    CALL(is_watched_path(directory, path), true, -1, REAL(linkat)(old_directory, old, directory, path, flags));
}

int unlink(const char *path)
{
    CALL(is_watched_path(AT_FDCWD, path), false, -1, REAL(unlink)(path));
}

int unlinkat(int directory, const char *path, int flags)
{
    CALL(is_watched_path(directory, path), false, -1, REAL(unlinkat)(directory, path, flags));
}

int mkdir(const char *path, mode_t mode)
{
    CALL(is_watched_path(AT_FDCWD, path), true, -1, REAL(mkdir)(path, mode));
}

int rmdir(const char *path)
{
    CALL(is_watched_path(AT_FDCWD, path), false, -1, REAL(rmdir)(path));
}
