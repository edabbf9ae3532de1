/* World texts that must be refused: with one line on stderr that names the file. */
#ifndef TAXEL_TESTS_REFUSAL_H
#define TAXEL_TESTS_REFUSAL_H

#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "check.h"
#include "emulator/world_file.h"

struct refusal {
    int saved, caught;
    char text[4096];
};

static inline void refusal_catch(struct refusal *refusal)
{
    fflush(stderr);
    refusal->saved = dup(2);
    refusal->caught = memfd_create("stderr", 0);
    dup2(refusal->caught, 2);
}

/* How many lines have come on stderr since; they are in `text`. */
static inline unsigned refusal_lines(struct refusal *refusal)
{
    unsigned lines = 0;
    fflush(stderr);
    dup2(refusal->saved, 2);
    close(refusal->saved);
    memset(refusal->text, 0, sizeof refusal->text);
    (void)!pread(refusal->caught, refusal->text, sizeof refusal->text - 1u, 0);
    close(refusal->caught);
    for (const char *c = refusal->text; *c; c++) {
        lines += *c == '\n';
    }
    return lines;
}

/* Reads the text as a world file. `world` stays to be freed. Returns world_file_read()'s result. */
static inline int refusal_read(struct refusal *refusal, struct world_description *world, const char *text, unsigned *lines)
{
    char path[] = "/tmp/taxel_test_XXXXXX";
    const int fd = mkstemp(path);
    CHECK(write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
    refusal_catch(refusal);
    const int result = world_file_read(world, path);
    *lines = refusal_lines(refusal);
    CHECK(!result || strstr(refusal->text, path));
    unlink(path);
    return result;
}

/* Each text is refused with one line. */
static inline void refusal_check_all(const char *const *texts, size_t count)
{
    static struct world_description world;
    static struct refusal refusal;
    for (size_t i = 0; i < count; i++) {
        unsigned lines;
        const int result = refusal_read(&refusal, &world, texts[i], &lines);
        if (!CHECK_EQUAL(result, -1) || !CHECK_EQUAL(lines, 1)) {
            printf("  (text %zu: %s)\n", i, texts[i]);
        }
        world_file_free(&world);
    }
}

#endif
