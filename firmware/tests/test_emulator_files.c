/* Input files of the emulator: an invalid world or stimulus is rejected with one line on stderr that names the file. */
#define _GNU_SOURCE
#include <math.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "check.h"
#include "emulator/physics/layer.h"
#include "emulator/base/random.h"
#include "fake_world.h"

#define MAP_3 "0700000000000000000000000000000000000000000000000000000000000000"
#define ID "0102030405060708"
#define BOARD "board 32 1 1 3 3 " MAP_3 " " ID " 0 5\n"
#define WORLD "taxel-world 1\n" BOARD

static struct world_description description;
static struct fake_world fake;
static char path[64];

/* Write bytes to a temporary file, whose path is in `path`. */
static void write_file(const void *bytes, size_t size)
{
    strcpy(path, "/tmp/taxel_test_XXXXXX");
    const int fd = mkstemp(path);
    CHECK(write(fd, bytes, size) == (ssize_t)size);
    close(fd);
}

static int saved_stderr, error_fd;

/* Redirect stderr to a temporary file, which count_stderr_lines() reads. */
static void redirect_stderr(void)
{
    fflush(stderr);
    saved_stderr = dup(2);
    error_fd = memfd_create("stderr", 0);
    dup2(error_fd, 2);
}

/* Return the number of lines on stderr since redirect_stderr(); *names_path becomes whether they contain `path`. */
static unsigned count_stderr_lines(bool *names_path)
{
    char text[4096] = {0};
    unsigned lines = 0;
    fflush(stderr);
    dup2(saved_stderr, 2);
    close(saved_stderr);
    (void)!pread(error_fd, text, sizeof text - 1u, 0);
    close(error_fd);
    for (const char *c = text; *c; c++) {
        lines += *c == '\n';
    }
    *names_path = strstr(text, path) != NULL;
    return lines;
}

/* Read a world file with this text. Returns the result of world_file_read(); writes the number of lines on stderr to
 * *lines, and whether they contain the path to *names_path. */
static int read_world(const void *text, size_t size, unsigned *lines, bool *names_path)
{
    write_file(text, size);
    redirect_stderr();
    const int result = world_file_read(&description, path);
    *lines = count_stderr_lines(names_path);
    unlink(path);
    return result;
}

static void valid_world_is_read(void)
{
    static const char text[] = "taxel-world 1\n# a comment\n\nseed 42\nscl_hz 1e6\nbaud 2000000\nusb_latency_ms 2\n"
                               "usb_latency_down_ms 3\nflow_control 1\n"
                               "hub_clock_ppm -20\nnoise_counts 0.5\nscan 100 50 2 9 10\n" BOARD
                               "board 0x21 2 16 16 1 " MAP_3 " " ID " 1.5 10 9 # with a map version\n"
                               "fault 1.5 unplug 32\nfault 1.5 plug 32\nfault 2 mute_host 0 1\n"
                               "wiring buffered 4700 15\nbranch index 2200 100 0.5 32\nbranch index 2200 100 0.5 33\n"
                               "fault 3 branch_short_ground 33 2 10";
    unsigned lines;
    bool names_path;
    CHECK_EQUAL(read_world(text, sizeof text - 1u, &lines, &names_path), 0);
    CHECK_EQUAL(lines, 0);
    CHECK_EQUAL(description.seed, 42);
    CHECK(description.scl_hz == 1e6 && description.noise_counts == 0.5 && description.hub_clock_ppm == -20.0);
    CHECK(description.usb_latency_down_ms == 3.0 && description.flow_control);
    CHECK_EQUAL(description.scan.idac_code, 9);
    CHECK_EQUAL(description.board_count, 2);
    CHECK_EQUAL(description.boards[0].unique_id[7], 8);
    CHECK_EQUAL(description.boards[1].map_version_override, 9);
    CHECK_EQUAL(description.fault_count, 4);
    CHECK(description.wiring.is_buffered && description.wiring.hub_pullup_ohm == 4700.0);
    CHECK_EQUAL(description.wiring.branch_count, 1);
    CHECK(description.wiring.branch_of[32] == 1 && description.wiring.branch_of[33] == 1);
    CHECK_EQUAL(description.faults[3].kind, FAULT_BRANCH_SHORT_GROUND);
    CHECK_EQUAL(description.faults[2].kind, FAULT_MUTE);
}

static const char *const invalid_worlds[] = {
    "",
    "\n",
    "taxel-world\n",
    "taxel-world 2\n" BOARD,
    "taxel-world 1\n",
    BOARD,
    WORLD "bord 1\n",
    WORLD "scl_hz\n",
    WORLD "scl_hz 0\n",
    WORLD "scl_hz 1e99\n",
    WORLD "scl_hz nan\n",
    WORLD "scl_hz inf\n",
    WORLD "scl_hz 400000x\n",
    WORLD "baud -5\n",
    WORLD "usb_latency_down_ms 256\n",
    WORLD "flow_control\n",
    WORLD "flow_control 2\n",
    WORLD "seed\n",
    WORLD "seed x\n",
    WORLD "seed -1\n",
    WORLD "seed 99999999999999999999999\n",
    WORLD "scan 160 40 1 16\n",
    WORLD "scan 0 40 1 16 0\n",
    WORLD "scan 65535 65535 1 16 0\n",
    WORLD "scan 1.5 40 1 16 0\n",
    WORLD "fault 1 unplug\n",
    WORLD "fault 1 explode 32\n",
    WORLD "fault 1 unplug 99\n",
    WORLD "fault -1 unplug 32\n",
    WORLD "fault\n",
    WORLD "fault 2 unplug 32\nfault 1 plug 32\n",
    WORLD "fault 1 hold_sda 32 -3\n",
    WORLD "fault 1 branch_open 32\n",
    WORLD "branch index 2200 100 0 32\nfault 1 branch_open 32 4\n",
    WORLD "branch index 2200 100 0 32\nfault 1 branch_short_ground 32 0\n",
    WORLD "branch index 2200 100 0 32\nfault 1 branch_short_supply 32 1.5\n",
    WORLD "branch index 2200 100 0 32\nfault 1 branch_resistance 32 3\n",
    WORLD "branch\n",
    WORLD "branch a\"b 2200 100 0 32\n",
    WORLD "branch index 2200 100 0\n",
    WORLD "branch index 50 100 0 32\n",
    WORLD "branch index -1 100 0 32\n",
    WORLD "branch index nan 100 0 32\n",
    WORLD "branch index 2200 0 0 32\n",
    WORLD "branch index 2200 100 0 99\n",
    WORLD "branch index 2200 100 0 32\nbranch index 2200 90 0 32\n",
    WORLD "branch index 2200 100 0 32\nbranch middle 2200 100 0 32\n",
    WORLD "wiring\n",
    WORLD "wiring ideal 0 10\n",
    WORLD "wiring passive\n",
    WORLD "wiring passive 50 10\n",
    "taxel-world 1\nboard\n",
    "taxel-world 1\nboard 32\n",
    "taxel-world 1\nboard 7 1 1 3 3 " MAP_3 " " ID " 0 5\n",
    "taxel-world 1\nboard 120 1 1 3 3 " MAP_3 " " ID " 0 5\n",
    "taxel-world 1\nboard 32 1 0 3 3 " MAP_3 " " ID " 0 5\n",
    "taxel-world 1\nboard 32 1 17 3 3 " MAP_3 " " ID " 0 5\n",
    "taxel-world 1\nboard 32 1 1 3 241 " MAP_3 " " ID " 0 5\n",
    "taxel-world 1\nboard 32 1 1 3 3 07 " ID " 0 5\n",
    "taxel-world 1\nboard 32 1 1 3 3 " MAP_3 " 01020304050607zz 0 5\n",
    "taxel-world 1\nboard 32 1 1 3 3 " MAP_3 " 010203040506071g 0 5\n",
    "taxel-world 1\nboard 32 1 1 3 3 " MAP_3 " 01020304050607-1 0 5\n",
    "taxel-world 1\nboard 32 1 1 3 3 " MAP_3 " " ID " 0\n",
    "taxel-world 1\nboard 32 1 1 3 3 " MAP_3 " " ID " 0 5 256\n",
};

static void invalid_world_is_rejected_with_one_line(void)
{
    for (size_t i = 0; i < sizeof invalid_worlds / sizeof invalid_worlds[0]; i++) {
        unsigned lines;
        bool names_path;
        const int result = read_world(invalid_worlds[i], strlen(invalid_worlds[i]), &lines, &names_path);
        if (!CHECK_EQUAL(result, -1) || !CHECK_EQUAL(lines, 1) || !CHECK(names_path)) {
            printf("  (world %zu: %s)\n", i, invalid_worlds[i]);
        }
    }
}

static void long_line_and_too_many_boards_or_faults_are_rejected(void)
{
    static char text[400000] = "taxel-world 1\n";
    unsigned lines;
    bool names_path;
    memset(text + 14, 'x', 2000);
    CHECK_EQUAL(read_world(text, 2014, &lines, &names_path), -1);
    CHECK_EQUAL(lines, 1);
    CHECK_EQUAL(read_world("taxel-world 1\n\0\n\0", 17, &lines, &names_path), -1);
    CHECK_EQUAL(lines, 1);
    size_t size = 14;
    for (unsigned i = 0; i <= WORLD_BOARDS_MAX; i++) {
        size += (size_t)snprintf(text + size, sizeof text - size, "%s", BOARD);
    }
    CHECK_EQUAL(read_world(text, size, &lines, &names_path), -1);
    CHECK_EQUAL(lines, 1);
    size = (size_t)snprintf(text, sizeof text, "%s", WORLD);
    for (unsigned i = 0; i <= WORLD_FAULTS_MAX; i++) {
        size += (size_t)snprintf(text + size, sizeof text - size, "fault 1 plug 32\n");
    }
    CHECK_EQUAL(read_world(text, size, &lines, &names_path), -1);
    CHECK_EQUAL(lines, 1);
    strcpy(path, "/tmp");
    redirect_stderr();
    CHECK_EQUAL(world_file_read(&description, "/tmp"), -1);
    CHECK_EQUAL(world_file_read(&description, "/tmp/no/such/file"), -1);
    CHECK_EQUAL(count_stderr_lines(&names_path), 2);
}

/* No damage causes a crash, and a rejected world always produces one line. */
static void randomly_damaged_world_is_read_or_rejected(void)
{
    static const char valid[] = WORLD "seed 42\nscl_hz 1e6\nscan 100 50 2 9 10\nfault 1.5 stretch 32 100\n";
    struct random_source random;
    char text[sizeof valid];
    random_init(&random, 11, 0);
    for (unsigned round = 0; round < 2000; round++) {
        memcpy(text, valid, sizeof valid);
        for (unsigned n = 0; n < 1 + round % 4; n++) {
            text[random_u64(&random) % (sizeof valid - 1u)] = (char)random_u64(&random);
        }
        unsigned lines;
        bool names_path;
        const int result = read_world(text, sizeof valid - 1u, &lines, &names_path);
        CHECK_EQUAL(lines, result ? 1 : 0);
    }
}

/* The map has the correct number of set bits, but one of them lies outside rows x columns. */
static void crossing_map_outside_the_lines_of_its_board_is_rejected(void)
{
    for (unsigned bit = 3; bit < 256; bit += 11) {
        fake_world_describe(&fake, 1, 3);
        struct board_description *board = &fake.description.boards[0];
        board->rows = 1;
        board->columns = 3;
        board->crossing_map[0] = 3;
        board->crossing_map[bit >> 3] |= (uint8_t)(1u << (bit & 7u));
        bool names_path;
        redirect_stderr();
        const int result = fake_world_open(&fake, -1);
        CHECK_EQUAL(count_stderr_lines(&names_path), 1);
        CHECK(result != 0);
        fake_world_close(&fake);
    }
}

/* Run a world with a stimulus of these bytes. Returns the result; writes the number of lines on stderr to *lines. */
static int run_stimulus(const uint8_t *bytes, size_t size, unsigned *lines)
{
    bool names_path;
    const int fd = memfd_create("stimulus", 0);
    CHECK(write(fd, bytes, size) == (ssize_t)size);
    lseek(fd, 0, SEEK_SET);
    fake_world_describe(&fake, 1, 2);
    strcpy(path, "stimulus test");
    redirect_stderr();
    int result = fake_world_open(&fake, fd);
    if (!result) {
        result = fake_world_run(&fake, 0.2);
    }
    *lines = count_stderr_lines(&names_path);
    CHECK(!result || names_path);
    fake_world_close(&fake);
    return result;
}

/* Write a valid stimulus of three records to `bytes`. Returns its size. */
static size_t fill_stimulus(uint8_t *bytes)
{
    static const double times[] = {0.0, 0.05, 0.1};
    memcpy(bytes, "TAXELSTM", 8);
    taxel_put_u32(bytes + 8, 1);
    taxel_put_u32(bytes + 12, 0);
    taxel_put_u32(bytes + 16, 2);
    taxel_put_u32(bytes + 20, 0);
    for (size_t i = 0; i < 3; i++) {
        const float values[2] = {1.0f, 2.0f};
        memcpy(bytes + 24 + 16 * i, &times[i], 8);
        memcpy(bytes + 32 + 16 * i, values, 8);
    }
    return 24 + 48;
}

static void invalid_stimulus_is_rejected_with_one_line(void)
{
    static const double invalid_times[] = {(double)INFINITY, (double)NAN, 1e9, 0.01};
    static const float invalid_values[] = {-1.0f, INFINITY, NAN};
    uint8_t bytes[128];
    unsigned lines;
    const size_t size = fill_stimulus(bytes);
    CHECK_EQUAL(run_stimulus(bytes, size, &lines), 0);
    CHECK_EQUAL(lines, 0);
    for (size_t length = 0; length < size; length++) {
        const bool between_records = length >= 24 && (length - 24) % 16 == 0;
        (void)fill_stimulus(bytes);
        CHECK_EQUAL(run_stimulus(bytes, length, &lines), between_records ? 0 : -1);
        CHECK_EQUAL(lines, between_records ? 0 : 1);
    }
    for (size_t position = 0; position < 20; position++) { /* of the header */
        (void)fill_stimulus(bytes);
        bytes[position] ^= 0x41;
        CHECK_EQUAL(run_stimulus(bytes, size, &lines), -1);
        CHECK_EQUAL(lines, 1);
    }
    for (size_t i = 0; i < 4; i++) {
        (void)fill_stimulus(bytes);
        memcpy(bytes + 24 + 32, &invalid_times[i], 8);
        CHECK_EQUAL(run_stimulus(bytes, size, &lines), -1);
        CHECK_EQUAL(lines, 1);
    }
    for (size_t i = 0; i < 3; i++) {
        (void)fill_stimulus(bytes);
        memcpy(bytes + 32 + 16 + 4, &invalid_values[i], 4);
        CHECK_EQUAL(run_stimulus(bytes, size, &lines), -1);
        CHECK_EQUAL(lines, 1);
    }
}

int main(void)
{
    RUN(valid_world_is_read);
    RUN(invalid_world_is_rejected_with_one_line);
    RUN(long_line_and_too_many_boards_or_faults_are_rejected);
    RUN(randomly_damaged_world_is_read_or_rejected);
    RUN(crossing_map_outside_the_lines_of_its_board_is_rejected);
    RUN(invalid_stimulus_is_rejected_with_one_line);
    return check_summary();
}
