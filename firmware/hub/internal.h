/* What the hub's own source files share. */
#ifndef TAXEL_HUB_INTERNAL_H
#define TAXEL_HUB_INTERNAL_H

#include "hub/hub.h"

#define TAXEL_NO_SLOT 0xFFu

uint64_t taxel_hub_clock(const struct taxel_hub *hub);
uint8_t taxel_hub_slot_of(const struct taxel_hub *hub, uint8_t address);

/* schedule.c */
void taxel_hub_start_next_job(struct taxel_hub *hub);
void taxel_hub_start_streaming(struct taxel_hub *hub);
void taxel_hub_start_sweep(struct taxel_hub *hub, bool for_command);

/* outcome.c */
void taxel_hub_finish_job(struct taxel_hub *hub, const struct taxel_job *job, int8_t result);
void taxel_hub_take_snapshot(struct taxel_hub *hub, const struct taxel_job *job);

/* A poll of the board has failed: its state, and a report if it is the first in a row. */
void taxel_hub_fail(struct taxel_hub *hub, struct taxel_hub_slot *board, uint8_t fault);
/* Free the bus. Returns the fault that remains, or TAXEL_BOARD_FAULT_NONE. */
uint8_t taxel_hub_free_bus(struct taxel_hub *hub);
/* Any transfer that runs to its stop shows that both lines move. */
void taxel_hub_note_result(struct taxel_hub *hub, int8_t result);

/* identify.c */
void taxel_hub_finish_identify(struct taxel_hub *hub, const struct taxel_job *job, struct taxel_hub_slot *board,
                               int8_t result);
void taxel_hub_finish_read_settings(struct taxel_hub *hub, const struct taxel_job *job, struct taxel_hub_slot *board,
                                    int8_t result);
void taxel_hub_finish_check_settings(struct taxel_hub *hub, const struct taxel_job *job, struct taxel_hub_slot *board,
                                     int8_t result);

/* recovery.c: 0, or the fault that remains (enum taxel_board_fault) */
uint8_t taxel_hub_recover_bus(struct taxel_hub *hub);

/* Whether the transmit ring, empty, holds a taxel frame with that much snapshot. */
bool taxel_hub_can_hold_snapshot(const struct taxel_hub *hub, size_t snapshot_size);
/* Whether a taxel frame with that much snapshot would fit after the one that is still to be framed. */
bool taxel_hub_has_room_for_snapshot(const struct taxel_hub *hub, size_t snapshot_size);
bool taxel_hub_has_room_for_reply(const struct taxel_hub *hub);

/* outbox.c: one frame of a head and a tail (either may be empty); false if there is no room for it now */
bool taxel_hub_try_send(struct taxel_hub *hub, uint8_t type, const uint8_t *head, size_t head_size, const uint8_t *tail,
                        size_t tail_size);
/* the same for what cannot be kept: without room it is dropped and counted */
bool taxel_hub_send(struct taxel_hub *hub, uint8_t type, const uint8_t *head, size_t head_size, const uint8_t *tail,
                    size_t tail_size);
void taxel_hub_send_fault(struct taxel_hub *hub, const struct taxel_hub_slot *slot, uint8_t fault);
void taxel_hub_log(struct taxel_hub *hub, uint8_t level, uint16_t code, const char *text);

/* inbox.c */
void taxel_hub_inbox_init(struct taxel_hub *hub);
void taxel_hub_read_inbox(struct taxel_hub *hub);
void taxel_hub_send_hello(struct taxel_hub *hub, uint8_t tag, uint8_t version);
void taxel_hub_reply(struct taxel_hub *hub, uint8_t status, const uint8_t *data, size_t size);

/* report.c */
void taxel_hub_start_report(struct taxel_hub *hub, bool for_command);
void taxel_hub_report_step(struct taxel_hub *hub);

#endif
