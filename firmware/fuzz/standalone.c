/* Replays files on a fuzz target without libFuzzer, with any compiler: the corpus in the C tests, or one crashing file.
 *
 *   fuzz_hub_replay FILE ...        every file once
 *   fuzz_hub_replay DIRECTORY ...   every file in it once */
#include <dirent.h>
#include <sys/stat.h>

#include "fuzz/fuzz.h"

#define PATH_SIZE 4096u

static unsigned files;

/* Run the fuzz target with the content of one file and print its path. Returns 0, or 1 with a message if the file
 * cannot be read. */
static int replay_file(const char *path)
{
    FILE *file = fopen(path, "rb");
    struct stat status;
    if (!file || fstat(fileno(file), &status)) {
        (void)fprintf(stderr, "%s: cannot be read\n", path);
        if (file) {
            (void)fclose(file);
        }
        return 1;
    }
    const size_t size = (size_t)status.st_size;
    uint8_t *bytes = malloc(size ? size : 1u); /* exact size, so that a sanitizer detects an access behind it */
    const bool is_complete = bytes && fread(bytes, 1, size, file) == size;
    (void)fclose(file);
    if (is_complete) {
        (void)fprintf(stderr, "%s\n", path); /* the last path printed is that of the failing file */
        (void)LLVMFuzzerTestOneInput(bytes, size);
        files++;
    } else {
        (void)fprintf(stderr, "%s: cannot be read completely\n", path);
    }
    free(bytes);
    return is_complete ? 0 : 1;
}

/* Run the fuzz target with each file of a directory, or with a single file. Returns the number of files that could not
 * be read. */
static int replay_directory(const char *path)
{
    char name[PATH_SIZE];
    int failures = 0;
    struct dirent *entry;
    DIR *directory = opendir(path);
    if (!directory) {
        return replay_file(path);
    }
    while ((entry = readdir(directory))) {
        if (entry->d_name[0] != '.' && snprintf(name, sizeof name, "%s/%s", path, entry->d_name) < (int)sizeof name) {
            failures += replay_file(name);
        }
    }
    (void)closedir(directory);
    return failures;
}

/* Replay the files and directories of the arguments, and print the number of files replayed. Exit status 1: a file
 * could not be read, or no file was replayed. */
int main(int argc, char **argv)
{
    int failures = 0;
    for (int i = 1; i < argc; i++) {
        failures += replay_directory(argv[i]);
    }
    printf("%u files replayed\n", files);
    return failures || !files ? 1 : 0;
}
