/* Status frames: once per second while streaming, and for GET_STATUS. At most one frame per pass, when there is
 * space for it. */
#include "hub/internal.h"

#define REPORT_PERIOD_US 1000000u
#define STEP_US 100u      /* between two frames of a report */
#define NO_SPACE_US 2000u /* before a frame without space is tried again */

/* Return the number of boards in the state STREAMING. */
static uint8_t count_streaming_boards(const struct taxel_hub *hub)
{
    uint8_t count = 0;
    for (uint8_t i = 0; i < hub->slot_count; i++) {
        count = (uint8_t)(count + (taxel_hub_slot_at(hub, i)->state == TAXEL_BOARD_STATE_STREAMING));
    }
    return count;
}

/* Queue a HUB_STATUS frame with the counters of the hub. Returns false if the ring has no space. */
TAXEL_OWN_FRAME static bool send_hub_status(struct taxel_hub *hub)
{
    uint8_t bytes[TAXEL_HUB_STATUS_SIZE];
    const struct taxel_hub_status status = {
        .uptime_us = taxel_hub_clock(hub),
        .cycles = hub->cycle.count,
        .cycle_time_us = hub->cycle.last_length_us,
        .frames_sent = hub->outbox.frames_sent,
        .bytes_sent = hub->outbox.bytes_sent,
        .frames_dropped = hub->outbox.frames_dropped,
        .commands = hub->inbox.commands,
        .commands_rejected = hub->inbox.commands_rejected,
        .bus_recoveries = hub->bus_recoveries,
        .boards_streaming = count_streaming_boards(hub),
        .streaming = hub->streaming,
    };
    taxel_hub_status_pack(&status, bytes);
    return taxel_hub_try_send(hub, TAXEL_FRAME_TYPE_HUB_STATUS, bytes, sizeof bytes, NULL, 0);
}

/* Return the number of polls of a board, modulo 2^32. The slot stores only the low 8 bits. The upper bits follow
 * from the sum of the outcome counters, which is at most 1 smaller (a poll in progress has no outcome yet). */
uint32_t taxel_hub_polls(const struct taxel_hub_slot *slot)
{
    const uint32_t ended = slot->forwarded + slot->repeated + slot->nacks + slot->timeouts + slot->crc_errors +
                           slot->bus_errors + slot->dropped;
    return ended + (uint8_t)(slot->polls - ended);
}

/* Queue a BOARD_STATUS frame with the poll counters of one board. Returns false if the ring has no space. */
TAXEL_OWN_FRAME static bool send_board_status(struct taxel_hub *hub, const struct taxel_hub_slot *slot)
{
    uint8_t bytes[TAXEL_BOARD_STATUS_SIZE];
    const struct taxel_board_status status = {
        .address = slot->address,
        .state = slot->state,
        .last_fault = slot->last_fault,
        .polls = taxel_hub_polls(slot),
        .forwarded = slot->forwarded,
        .repeated = slot->repeated,
        .nacks = slot->nacks,
        .timeouts = slot->timeouts,
        .crc_errors = slot->crc_errors,
        .bus_errors = slot->bus_errors,
        .dropped = slot->dropped,
        .retries = slot->retries,
    };
    taxel_board_status_pack(&status, bytes);
    return taxel_hub_try_send(hub, TAXEL_FRAME_TYPE_BOARD_STATUS, bytes, sizeof bytes, NULL, 0);
}

/* Begin a status report: the hub's status, then that of each board. `for_command`: a reply to GET_STATUS follows. */
void taxel_hub_start_report(struct taxel_hub *hub, bool for_command)
{
    hub->report.active = true;
    hub->report.for_command = for_command;
    hub->report.next = 0;
}

/* Queue the next frame of the status report in progress, and after the last frame the reply to GET_STATUS if that
 * command requested the report. Returns false if there is no space for the frame. */
static bool send_next(struct taxel_hub *hub)
{
    struct taxel_report *report = &hub->report;
    const bool sent = report->next == 0 ? send_hub_status(hub)
                                        : send_board_status(hub, taxel_hub_slot_at(hub, (uint8_t)(report->next - 1u)));
    if (!sent) {
        return false;
    }
    report->next++;
    if (report->next > hub->slot_count) {
        report->active = false;
        if (report->for_command) {
            taxel_hub_reply(hub, TAXEL_REPLY_STATUS_OK, NULL, 0);
        }
    }
    return true;
}

/* Queue a LOG frame if bytes from the host have been lost since the last such frame. */
static void report_overruns(struct taxel_hub *hub)
{
    if (hub->inbox.overruns_reported != hub->inbox.overruns) {
        hub->inbox.overruns_reported = hub->inbox.overruns;
        taxel_hub_log(hub, TAXEL_LOG_LEVEL_WARNING, TAXEL_LOG_CODE_RECEIVE_OVERRUN, "bytes lost");
    }
}

/* Execute one step of the status report in a pass of the main loop: begin a report every second while streaming, queue
 * at most one frame of it, and request the next pass. Lost bytes from the host are reported, too. */
void taxel_hub_report_step(struct taxel_hub *hub)
{
    struct taxel_report *report = &hub->report;
    const uint32_t now = taxel_hub_now(hub);
    report_overruns(hub);
    if (!report->active && hub->streaming && taxel_hub_is_due(now, report->next_us)) {
        report->next_us = now + REPORT_PERIOD_US;
        taxel_hub_start_report(hub, false);
    }
    const bool sent = report->active && send_next(hub);
    if (report->active) {
        taxel_hub_wake_in(hub, sent ? STEP_US : NO_SPACE_US);
    } else if (hub->streaming) {
        taxel_hub_wake_in(hub, taxel_hub_is_due(now, report->next_us) ? 0 : report->next_us - now);
    }
}
