/* Effects on whole worlds: effects of strength zero, boards that do not respond, delays, exchanged boards, clocks. */
#define _GNU_SOURCE
#include <math.h>
#include <sys/mman.h>
#include <unistd.h>

#include "effects_bench.h"
#include "fake_world.h"

#define BOARDS 2u
#define TAXELS 20u
#define ALL (BOARDS * TAXELS)

static struct fake_world fake;

/* Write a stimulus of forces in newtons to a temporary file and return its descriptor: taxel `pressed` carries `force`
 * from `at` on, ramped over `ramp` seconds; -1: all taxels, each with a different force. */
static int stimulus_fd(int pressed, float force, double at, double ramp)
{
    uint8_t header[24] = "TAXELSTM";
    const double times[] = {0.0, at, at + ramp, 9.0};
    const int fd = memfd_create("stimulus", 0);
    taxel_put_u32(header + 8, 1);
    taxel_put_u32(header + 16, ALL);
    bool written = write(fd, header, sizeof header) == (ssize_t)sizeof header;
    for (size_t n = 0; n < 4; n++) {
        float row[ALL];
        for (size_t i = 0; i < ALL; i++) {
            row[i] = n < 2               ? 0.0f
                     : pressed < 0       ? force * (float)(i + 1u) / (float)ALL
                     : (int)i == pressed ? force
                                         : 0.0f;
        }
        written = written && write(fd, &times[n], sizeof times[n]) == (ssize_t)sizeof times[n] &&
                  write(fd, row, sizeof row) == (ssize_t)sizeof row;
    }
    CHECK(written);
    lseek(fd, 0, SEEK_SET);
    return fd;
}

/* Create a world with these effect lines (ended by NULL) and a stimulus from a file descriptor (-1: none), and start
 * the stream. */
static void start_world(const char *const *effects, int fd)
{
    fake_world_describe(&fake, BOARDS, TAXELS);
    for (; effects && *effects; effects++) {
        if (!CHECK(read_effect(&fake.description, *effects) == 0)) {
            printf("  effect %s\n", *effects);
        }
    }
    CHECK_EQUAL(fake_world_open(&fake, fd), 0);
    CHECK(fake_world_start(&fake));
}

/* Return the CRC of all bytes that the hub sends in a world with this effect line; NULL: no effect. */
static uint32_t stream_crc_with(const char *effect)
{
    const char *const effects[] = {effect, NULL};
    start_world(effect ? effects : NULL, stimulus_fd(-1, 2.0f, 0.55, 0.1));
    CHECK_EQUAL(fake_world_run(&fake, 0.3), 0);
    const uint32_t crc = fake.stream_crc;
    CHECK(fake.stream_bytes > 1000);
    fake_world_close(&fake);
    return crc;
}

static void effects_of_strength_zero_change_no_byte(void)
{
    static const char *const inactive[] = {"coupling resistive tx_ohm=0 rx_ohm=0",
                                           "coupling traces picofarad=0",
                                           "noise white counts=0",
                                           "noise line axis=0 counts=0",
                                           "noise pink counts=0",
                                           "noise impulse counts=0 rate_hz=5",
                                           "noise impulse counts=9 rate_hz=0",
                                           "gain electrode log_std=0",
                                           "gain idac factor=1",
                                           "drift warm_up counts=0 seconds=5",
                                           "drift wander counts=0 seconds=5",
                                           "saturation clip counts=50 strength=0",
                                           "saturation soft counts=50 strength=0",
                                           "dead rest board=0x20 taxel=0 strength=0",
                                           "silent from board=0x20 seconds=0 duration=0",
                                           "silent flaky p=0",
                                           "late delay seconds=0",
                                           "late lag seconds=0",
                                           "clock skew ppm=0",
                                           "clock wander ppm=0 period=10",
                                           "exchange lines board=0x20 axis=1 index=2 other=2",
                                           "droop supply ohms=0",
                                           "droop reference ohms=0",
                                           "nonlinear dead_zone leak=0",
                                           "nonlinear bow counts=0"};
    const uint32_t ideal = stream_crc_with(NULL);
    for (size_t i = 0; i < sizeof inactive / sizeof inactive[0]; i++) {
        if (!CHECK_EQUAL(stream_crc_with(inactive[i]), ideal)) {
            printf("  effect %s\n", inactive[i]);
        }
    }
}

static void active_effects_change_bytes_reproducibly(void)
{
    static const char *const active[] = {"coupling resistive tx_ohm=2000 rx_ohm=2000",
                                         "coupling traces picofarad=2",
                                         "noise white counts=3",
                                         "noise line axis=0 counts=3",
                                         "noise pink counts=3",
                                         "noise impulse counts=90 rate_hz=20",
                                         "gain electrode log_std=0.1",
                                         "gain idac factor=0.9",
                                         "drift warm_up counts=50 seconds=5",
                                         "drift wander counts=20 seconds=5",
                                         "saturation clip counts=50",
                                         "saturation soft counts=500",
                                         "dead rest board=0x21 taxel=9",
                                         "dead stuck board=0x20 taxel=0 value=5",
                                         "line open board=0x20 axis=1 index=1",
                                         "line short board=0x20 axis=1 index=1",
                                         "silent from board=0x20 seconds=0.6 duration=0.1",
                                         "silent flaky p=0.2",
                                         "late delay seconds=0.05",
                                         "late lag seconds=0.1",
                                         "clock skew ppm=9000",
                                         "clock wander ppm=9000 period=2",
                                         "exchange boards board=0x20 other=0x21",
                                         "exchange lines board=0x20 axis=1 index=2 other=3",
                                         "stuck_bit low bit=2",
                                         "stuck_bit high bit=12",
                                         "droop supply ohms=2000",
                                         "droop reference ohms=2000",
                                         "nonlinear dead_zone leak=0.01",
                                         "nonlinear bow counts=30"};
    const uint32_t ideal = stream_crc_with(NULL);
    for (size_t i = 0; i < sizeof active / sizeof active[0]; i++) {
        const uint32_t crc = stream_crc_with(active[i]);
        if (!CHECK(crc != ideal) || !CHECK_EQUAL(stream_crc_with(active[i]), crc)) {
            printf("  effect %s\n", active[i]);
        }
    }
}

static void a_silent_board_loses_frames_and_the_other_board_does_not(void)
{
    static const char *const effects[] = {"silent from board=0x20 seconds=0.7", NULL};
    start_world(effects, -1);
    CHECK_EQUAL(fake_world_run(&fake, 0.3), 0);
    const unsigned before = fake.frames_of[0x20], other = fake.frames_of[0x21];
    CHECK_EQUAL(fake_world_run(&fake, 0.5), 0);
    CHECK(before > 5);
    CHECK(fake.frames_of[0x20] <= before + 1u);
    CHECK(fake.frames_of[0x21] > other + 20u);
    CHECK(fake_world_slot(&fake, 0x20)->nacks > 0);
    CHECK_EQUAL(fake_world_slot(&fake, 0x21)->nacks, 0);
    CHECK(fake_world_adds_up(&fake));
    fake_world_close(&fake);
}

static void a_silent_board_resumes_after_its_outage(void)
{
    static const char *const effects[] = {"silent from board=0x20 seconds=0.7 duration=0.3", NULL};
    start_world(effects, -1);
    CHECK_EQUAL(fake_world_run(&fake, 0.45), 0);
    const unsigned before = fake.frames_of[0x20];
    CHECK_EQUAL(fake_world_run(&fake, 4.0), 0);
    CHECK(fake.frames_of[0x20] > before + 20u);
    fake_world_close(&fake);
}

static void a_loose_contact_loses_addressings_in_bursts(void)
{
    struct silent_effect silent = {0};
    struct silent_contact contact;
    unsigned lost = 0, bursts = 0;
    const unsigned n = 200000;
    silent.probability[0] = 0.1;
    silent.burst[0] = 5.0;
    silent_open(&contact, &silent, 0, 3, 0x20);
    bool last = false;
    for (unsigned i = 0; i < n; i++) {
        const bool now = silent_loses_addressing(&silent, 0, 0.0, &contact);
        lost += now;
        bursts += now && !last;
        last = now;
    }
    CHECK_BETWEEN((double)lost / n, 0.09, 0.11);
    CHECK_BETWEEN((double)lost / bursts, 4.6, 5.4);
}

/* Return the virtual time in seconds at which the raw count of a taxel has fallen by 200 counts, in a world with these
 * effects; 0 if it does not fall within 0.5 s. */
static double contact_time(const char *const *effects, unsigned address, size_t taxel, int fd)
{
    start_world(effects, fd);
    const int rest_count = fake.counts_of[address][taxel];
    double time = 0.0;
    for (int n = 0; n < 500 && time == 0.0; n++) {
        CHECK_EQUAL(fake_world_run_in_steps(&fake, 0.001, VTIME_MS), 0);
        if (rest_count - fake.counts_of[address][taxel] > 200) {
            time = (double)fake.world.now / (double)VTIME_SECOND;
        }
    }
    fake_world_close(&fake);
    return time;
}

static void a_delayed_board_reports_contact_after_its_delay(void)
{
    static const char *const effects[] = {"late delay board=0x20 seconds=0.1", NULL};
    const double ideal = contact_time(NULL, 0x20, 4, stimulus_fd(4, 3.0f, 0.6, 0.001));
    const double late = contact_time(effects, 0x20, 4, stimulus_fd(4, 3.0f, 0.6, 0.001));
    CHECK_BETWEEN(ideal, 0.6, 0.63);
    CHECK_BETWEEN(late - ideal, 0.09, 0.11);
    const double other = contact_time(effects, 0x21, 4, stimulus_fd(TAXELS + 4, 3.0f, 0.6, 0.001));
    CHECK_BETWEEN(other - ideal, -0.015, 0.015);
}

static void line_coupling_does_not_change_the_delay_of_a_late_board(void)
{
    static const char *const effects[] = {"late delay board=0x20 seconds=0.1",
                                          "coupling resistive tx_ohm=500 rx_ohm=500", NULL};
    const double ideal = contact_time(NULL, 0x20, 4, stimulus_fd(4, 3.0f, 0.6, 0.001));
    CHECK_BETWEEN(contact_time(effects, 0x20, 4, stimulus_fd(4, 3.0f, 0.6, 0.001)) - ideal, 0.09, 0.11);
}

static void delayed_fields_are_interpolated_between_records(void)
{
    struct late_history *history = late_history_open(1, 0.5);
    for (int n = 0; n < 1000; n++) {
        struct taxel_field *fields =
            late_history_add(history, (vtime)n * 10u * VTIME_MS, false, (vtime)(n + 1) * 10u * VTIME_MS);
        fields[0].rise = n;
    }
    CHECK(history->count < 80u && history->capacity <= 128u);
    const struct late_span span = late_history_span_at(history, 9505u * VTIME_MS, 10000u * VTIME_MS);
    CHECK_BETWEEN(span.before->rise + span.fraction * (span.after->rise - span.before->rise), 950.499, 950.501);
    late_history_free(history);
}

static void exchanged_boards_measure_the_contact_on_each_other(void)
{
    static const char *const effects[] = {"exchange boards board=0x20 other=0x21", NULL};
    for (int n = 0; n < 2; n++) {
        start_world(n ? effects : NULL, stimulus_fd(4, 3.0f, 0.55, 0.001));
        const int rest_count[2] = {fake.counts_of[0x20][4], fake.counts_of[0x21][4]};
        CHECK_EQUAL(fake_world_run(&fake, 0.2), 0);
        CHECK(rest_count[n] - fake.counts_of[0x20 + n][4] > 200);
        CHECK(abs(rest_count[1 - n] - fake.counts_of[0x21 - n][4]) < 30);
        fake_world_close(&fake);
    }
}

static void a_board_with_a_clock_5_percent_too_fast_scans_5_percent_faster(void)
{
    static const char *const effects[] = {"clock skew board=0x20 ppm=50000", NULL};
    start_world(effects, -1);
    CHECK_EQUAL(fake_world_run(&fake, 2.0), 0);
    const double ratio = (double)fake.world.boards[0].conversions / (double)fake.world.boards[1].conversions;
    CHECK_BETWEEN(ratio, 1.045, 1.055);
    fake_world_close(&fake);
}

static void the_offset_of_a_drifting_clock_is_the_integral_of_its_rate(void)
{
    struct clock_effect effect = {0};
    effect.drift_ppm[0] = 200.0;
    effect.period[0] = 30.0;
    const struct clock_drift drift = clock_drift_open(&effect, 0, 1, 0x20);
    double sum = 0.0, max_count = 0.0;
    for (int n = 0; n < 47000; n++) {
        const double time = n * 0.001;
        sum += 0.001 * (clock_drift_factor(&drift, time + 0.0005) - 1.0);
        max_count = fmax(max_count, fabs(clock_drift_factor(&drift, time) - 1.0));
    }
    CHECK_BETWEEN(max_count, 1.99e-4, 2.01e-4);
    CHECK_BETWEEN(clock_drift_offset(&drift, 47.0) - sum, -1e-8, 1e-8);
}

static void contact_on_one_board_lowers_the_supply_of_all_boards(void)
{
    static const char *const effects[] = {"droop supply ohms=20000", NULL};
    int change[2];
    for (int n = 0; n < 2; n++) {
        start_world(n ? effects : NULL, stimulus_fd(4, 10.0f, 0.55, 0.001));
        const int rest_count = fake.counts_of[0x21][7];
        CHECK_EQUAL(fake_world_run(&fake, 0.2), 0);
        change[n] = fake.counts_of[0x21][7] - rest_count;
        fake_world_close(&fake);
    }
    CHECK(abs(change[0]) < 25);
    CHECK_BETWEEN(change[1], 20, 100); /* 20 kOhm * 1.2 MHz * 0.4 pF * (0.6 to 1): about 1 % of 4000 counts */
}

int main(void)
{
    RUN(effects_of_strength_zero_change_no_byte);
    RUN(active_effects_change_bytes_reproducibly);
    RUN(a_silent_board_loses_frames_and_the_other_board_does_not);
    RUN(a_silent_board_resumes_after_its_outage);
    RUN(a_loose_contact_loses_addressings_in_bursts);
    RUN(a_delayed_board_reports_contact_after_its_delay);
    RUN(line_coupling_does_not_change_the_delay_of_a_late_board);
    RUN(delayed_fields_are_interpolated_between_records);
    RUN(exchanged_boards_measure_the_contact_on_each_other);
    RUN(a_board_with_a_clock_5_percent_too_fast_scans_5_percent_faster);
    RUN(the_offset_of_a_drifting_clock_is_the_integral_of_its_rate);
    RUN(contact_on_one_board_lowers_the_supply_of_all_boards);
    return check_summary();
}
