/* Helpers for world texts that must be rejected with one line on stderr that names the file. */
#ifndef TAXEL_TESTS_REJECTION_H
#define TAXEL_TESTS_REJECTION_H

#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "check.h"
#include "emulator/world_file/world_file.h"

struct rejection {
    int saved, caught;
    char text[4096];
};

/* Redirect stderr to a temporary file, which rejection_lines() reads. */
static inline void rejection_catch(struct rejection *rejection)
{
    fflush(stderr);
    rejection->saved = dup(2);
    rejection->caught = memfd_create("stderr", 0);
    dup2(rejection->caught, 2);
}

/* Return the number of lines written to stderr since rejection_catch(); `text` contains them. */
static inline unsigned rejection_lines(struct rejection *rejection)
{
    unsigned lines = 0;
    fflush(stderr);
    dup2(rejection->saved, 2);
    close(rejection->saved);
    memset(rejection->text, 0, sizeof rejection->text);
    (void)!pread(rejection->caught, rejection->text, sizeof rejection->text - 1u, 0);
    close(rejection->caught);
    for (const char *c = rejection->text; *c; c++) {
        lines += *c == '\n';
    }
    return lines;
}

/* Read the text as a world file, and return world_file_read()'s result. The caller frees `world`. */
static inline int rejection_read(struct rejection *rejection, struct world_description *world, const char *text,
                                 unsigned *lines)
{
    char path[] = "/tmp/taxel_test_XXXXXX";
    const int fd = mkstemp(path);
    CHECK(write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
    rejection_catch(rejection);
    const int result = world_file_read(world, path);
    *lines = rejection_lines(rejection);
    CHECK(!result || strstr(rejection->text, path));
    unlink(path);
    return result;
}

/* Check that each text is rejected with one line. */
static inline void rejection_check_all(const char *const *texts, size_t count)
{
    static struct world_description world;
    static struct rejection rejection;
    for (size_t i = 0; i < count; i++) {
        unsigned lines;
        const int result = rejection_read(&rejection, &world, texts[i], &lines);
        if (!CHECK_EQUAL(result, -1) || !CHECK_EQUAL(lines, 1)) {
            printf("  (text %zu: %s)\n", i, texts[i]);
        }
        world_file_free(&world);
    }
}

#endif
