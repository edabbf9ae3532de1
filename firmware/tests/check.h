/* Checks for the C tests. A test is a function, which RUN() counts as failed if any CHECK in it failed. Each CHECK
 * macro prints file, line, expected and found value after a failure, and returns whether the check passed. */
#ifndef TAXEL_TESTS_CHECK_H
#define TAXEL_TESTS_CHECK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#define CHECK_LINES_MAX 8u /* failures printed per test */

struct check_state {
    unsigned passed, failed;
    unsigned failures; /* of the current test */
};

static struct check_state check_state;

/* Count a failure of the current test. Returns whether it is to be printed; then file and line have been printed. */
static inline bool check_failed(const char *file, int line)
{
    check_state.failures++;
    if (check_state.failures > CHECK_LINES_MAX) {
        return false;
    }
    printf("  %s:%d: ", file, line);
    return true;
}

/* Check that a condition is true; CHECK() calls this function. */
static inline bool check_true(bool is_true, const char *file, int line, const char *expression)
{
    if (!is_true && check_failed(file, line)) {
        printf("expected %s\n", expression);
    }
    return is_true;
}

/* Check that two integers are equal; CHECK_EQUAL() calls this function. */
static inline bool check_equal(long long actual, long long expected, const char *file, int line, const char *expression)
{
    if (actual != expected && check_failed(file, line)) {
        printf("%s: expected %lld (0x%llX), found %lld (0x%llX)\n", expression, expected, (unsigned long long)expected,
               actual, (unsigned long long)actual);
    }
    return actual == expected;
}

/* Check that a number is in a closed interval; CHECK_BETWEEN() calls this function. */
static inline bool check_between(double actual, double low, double high, const char *file, int line,
                                 const char *expression)
{
    const bool is_inside = actual >= low && actual <= high;
    if (!is_inside && check_failed(file, line)) {
        printf("%s: expected %g to %g, found %g\n", expression, low, high, actual);
    }
    return is_inside;
}

/* Check that `size` bytes are equal; CHECK_BYTES() calls this function. */
static inline bool check_bytes(const void *actual, const void *expected, size_t size, const char *file, int line,
                               const char *expression)
{
    const uint8_t *a = actual, *e = expected;
    for (size_t i = 0; i < size; i++) {
        if (a[i] != e[i]) {
            if (check_failed(file, line)) {
                printf("%s, byte %zu of %zu: expected 0x%02X, found 0x%02X\n", expression, i, size, e[i], a[i]);
            }
            return false;
        }
    }
    return true;
}

#define CHECK(expression) check_true((expression), __FILE__, __LINE__, #expression)
#define CHECK_EQUAL(actual, expected) \
    check_equal((long long)(actual), (long long)(expected), __FILE__, __LINE__, #actual)
#define CHECK_BETWEEN(actual, low, high) check_between((double)(actual), (low), (high), __FILE__, __LINE__, #actual)
#define CHECK_BYTES(actual, expected, size) check_bytes((actual), (expected), (size), __FILE__, __LINE__, #actual)

/* Run a test and count it as passed or failed. */
static inline void check_run(void (*test)(void), const char *name)
{
    check_state.failures = 0;
    test();
    if (check_state.failures) {
        check_state.failed++;
        printf("FAILED %s (%u checks)\n", name, check_state.failures);
    } else {
        check_state.passed++;
    }
}

#define RUN(test) check_run(test, #test)

/* Print the last line of every test. Returns its exit status. */
static inline int check_summary(void)
{
    printf("%u passed, %u failed\n", check_state.passed, check_state.failed);
    return check_state.failed ? 1 : 0;
}

#endif
