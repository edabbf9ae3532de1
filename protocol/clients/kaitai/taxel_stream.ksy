# Generated from protocol/taxel_protocol by tools/codegen/clients.py (make generate). Do not edit.
meta:
  id: taxel_stream
  title: Stream of a taxel hub
  license: MIT
  endian: le
  bit-endian: le
doc: |
  Frames of a stream between hub and host. Input: the bytes of the stream, such as the bytes of all records of a
  capture file (taxel_capture.ksy) in their order. The process taxel_deframe finds the intact frames and removes the
  byte stuffing (taxel_deframe.py); whitening and all fields are described here. Counts of delta frames are coded
  against an earlier frame, which a description cannot express: they remain bytes (`coded`).
doc-ref: protocol/SPEC.md
seq:
  - id: frames
    size-eos: true
    process: taxel_deframe
    type: frame_list
types:
  frame_list:
    seq:
      - id: entries
        type: frame
        repeat: eos
  frame:
    seq:
      - id: is_known
        doc: 0 if this version does not define the type of the frame, or not with this payload
        type: u1
      - id: len_body
        type: u2
      - id: body
        size: len_body
        process: xor([165, 164, 159, 134, 9, 152, 99, 90, 45, 76, 231, 238, 17, 192, 43, 66, 181, 244, 47, 86, 25, 232, 243, 42, 61, 156, 119, 190, 33, 16, 187, 18, 197, 68, 191, 38, 41, 56, 131, 250, 77, 236, 7, 142, 49, 96, 75, 226, 213, 148, 79, 246, 57, 136, 19, 202, 93, 60, 151, 94, 65, 176, 219, 178, 229, 228, 223, 198, 73, 216, 163, 154, 109, 140, 39, 46, 81, 0, 107, 130, 245, 52, 111, 150, 89, 40, 51, 106, 125, 220, 183, 254, 97, 80, 251, 82, 5, 132, 255, 102, 105, 120, 195, 58, 141, 44, 71, 206, 113, 160, 139, 34, 21, 212, 143, 54, 121, 200, 83, 10, 157, 124, 215, 158, 129, 240, 27, 242, 37, 36, 31, 6, 137, 24, 227, 218, 173, 204, 103, 110, 145, 64, 171, 194, 53, 116, 175, 214, 153, 104, 115, 170, 189, 28, 247, 62, 161, 144, 59, 146, 69, 196, 63, 166, 169, 184, 3, 122, 205, 108, 135, 14, 177, 224, 203, 98, 85, 20, 207, 118, 185, 8, 147, 74, 221, 188, 23, 222, 193, 48, 91, 50, 101, 100, 95, 70, 201, 88, 35, 26, 237, 12, 167, 174, 209, 128, 235, 2, 117, 180, 239, 22, 217, 168, 179, 234, 253, 92, 55, 126, 225, 208, 123, 210, 133, 4, 127, 230, 233, 248, 67, 186, 13, 172, 199, 78, 241, 32, 11, 162, 149, 84, 15, 182, 249, 72, 211, 138, 29, 252, 87, 30, 1, 112, 155, 114])
        type:
          switch-on: is_known
          cases:
            0: unknown_body
            1: body
  unknown_body:
    seq:
      - id: type
        type: u1
      - id: sequence
        type: u2
      - id: len_payload
        type: u2
      - id: payload
        size: len_payload
      - id: crc32
        type: u4
  body:
    seq:
      - id: type
        type: u1
        enum: frame_type
      - id: sequence
        type: u2
      - id: len_payload
        type: u2
      - id: payload
        size: len_payload
        type:
          switch-on: type
          cases:
            'frame_type::hub_handshake': payload_hub_handshake
            'frame_type::taxels': payload_taxels
            'frame_type::compact_taxels': payload_compact_taxels
            'frame_type::hub_status': payload_hub_status
            'frame_type::board_status': payload_board_status
            'frame_type::board_info': payload_board_info
            'frame_type::board_fault': payload_board_fault
            'frame_type::time_sync': payload_time_sync
            'frame_type::log': payload_log
            'frame_type::reply': payload_reply
            'frame_type::host_handshake': payload_host_handshake
            'frame_type::command': payload_command
            'frame_type::acknowledge': payload_acknowledge
      - id: crc32
        type: u4
  payload_hub_handshake:
    seq:
      - id: fields
        type: hub_handshake
  payload_taxels:
    seq:
      - id: header
        type: taxel_header
      - id: snapshot_header
        type: snapshot_header
      - id: raw_counts
        type: u2
        repeat: expr
        repeat-expr: header.taxel_count
      - id: crc32
        type: u4
  payload_compact_taxels:
    seq:
      - id: header
        type: taxel_header
      - id: snapshot
        type: compact_header
      - id: data
        size-eos: true
    instances:
      compact:
        doc: parsed on access
        pos: 8
        size-eos: true
        type: compact_snapshot(header.taxel_count)
  payload_hub_status:
    seq:
      - id: fields
        type: hub_status
  payload_board_status:
    seq:
      - id: fields
        type: board_status
  payload_board_info:
    seq:
      - id: fields
        type: board_info
  payload_board_fault:
    seq:
      - id: fields
        type: board_fault_report
  payload_time_sync:
    seq:
      - id: fields
        type: time_sync
  payload_log:
    seq:
      - id: fields
        type: log_header
      - id: text
        size-eos: true
  payload_reply:
    seq:
      - id: fields
        type: reply_header
      - id: data
        size-eos: true
  payload_host_handshake:
    seq:
      - id: fields
        type: host_handshake
  payload_command:
    seq:
      - id: fields
        type: command_header
      - id: arguments
        size-eos: true
  payload_acknowledge:
    seq:
      - id: acknowledgements
        type: acknowledgement
        repeat: eos
  identity:
    seq:
      - id: who_am_i
        type: u1
      - id: map_version
        type: u1
      - id: firmware_major
        type: u1
      - id: firmware_minor
        type: u1
      - id: firmware_patch
        type: u1
      - id: kind
        type: u1
      - id: address
        type: u1
      - id: map_revision
        type: u1
      - id: unique_id
        size: 8
      - id: rows
        type: u1
      - id: columns
        type: u1
      - id: taxel_count
        type: u2
      - id: snapshot_size
        type: u2
      - id: crossing_map
        size: 32
      - id: crc32
        type: u4
  status:
    seq:
      - id: state
        type: u1
      - id: error_flags
        type: u1
      - id: reset_cause
        type: u1
        enum: reset_cause
      - id: settings_generation
        type: u1
      - id: clock_us
        type: u4
      - id: scans
        type: u4
      - id: scan_time_us
        type: u4
      - id: snapshot_reads
        type: u4
      - id: bus_errors
        type: u2
      - id: rejected_writes
        type: u2
      - id: front_end
        type: u1
      - id: reserved
        type: u1
      - id: saturated_conversions
        type: u2
  scan_settings:
    seq:
      - id: sub_conversions
        type: u2
      - id: sense_clock_divider
        type: u2
      - id: modulator_clock_divider
        type: u1
      - id: idac_code
        type: u1
      - id: settle_cycles
        type: u2
  settings_register:
    seq:
      - id: settings_sub_conversions
        type: u2
      - id: settings_sense_clock_divider
        type: u2
      - id: settings_modulator_clock_divider
        type: u1
      - id: settings_idac_code
        type: u1
      - id: settings_settle_cycles
        type: u2
      - id: crc32
        type: u4
  command_register:
    seq:
      - id: command
        type: u1
        enum: command
      - id: complement
        type: u1
  enter_bootloader_register:
    seq:
      - id: command
        type: u1
        enum: command
      - id: complement
        type: u1
      - id: key
        type: u4
  fault_record:
    seq:
      - id: code
        type: u1
      - id: exception
        type: u1
      - id: count
        type: u2
      - id: program_counter
        type: u4
      - id: link_register
        type: u4
  fault_register:
    seq:
      - id: record_code
        type: u1
      - id: record_exception
        type: u1
      - id: record_count
        type: u2
      - id: record_program_counter
        type: u4
      - id: record_link_register
        type: u4
      - id: crc32
        type: u4
  snapshot_header:
    seq:
      - id: sequence
        type: u2
      - id: timestamp_us
        type: u4
  compact_header:
    seq:
      - id: sequence
        type: u2
      - id: format
        type: u1
  compact_packed:
    seq:
      - id: sequence
        type: u2
      - id: format
        type: u1
      - id: timestamp_us
        type: u4
  compact_delta:
    seq:
      - id: sequence
        type: u2
      - id: format
        type: u1
      - id: key_frame
        type: u2
      - id: timestamp_low
        size: 3
  compact_acknowledge:
    seq:
      - id: key_frame
        type: u2
  host_handshake:
    seq:
      - id: tag
        type: u1
      - id: version_min
        type: u1
      - id: version_max
        type: u1
  hub_handshake:
    seq:
      - id: tag
        type: u1
      - id: version_min
        type: u1
      - id: version_max
        type: u1
      - id: version_chosen
        type: u1
      - id: reset_cause
        type: u1
        enum: reset_cause
      - id: firmware_major
        type: u1
      - id: firmware_minor
        type: u1
      - id: firmware_patch
        type: u1
      - id: unique_id
        size: 8
      - id: uptime_us
        type: u8
  taxel_header:
    seq:
      - id: address
        type: u1
      - id: taxel_count
        type: u1
      - id: cycle
        type: u2
      - id: hub_time_us
        type: u4
  hub_status:
    seq:
      - id: uptime_us
        type: u8
      - id: cycles
        type: u4
      - id: cycle_time_us
        type: u4
      - id: frames_sent
        type: u4
      - id: bytes_sent
        type: u4
      - id: frames_dropped
        type: u4
      - id: commands
        type: u4
      - id: commands_rejected
        type: u4
      - id: bus_recoveries
        type: u4
      - id: boards_streaming
        type: u1
      - id: streaming
        type: u1
  board_status:
    seq:
      - id: address
        type: u1
      - id: state
        type: u1
      - id: last_fault
        type: u1
        enum: board_fault
      - id: polls
        type: u4
      - id: forwarded
        type: u4
      - id: repeated
        type: u4
      - id: nacks
        type: u4
      - id: timeouts
        type: u4
      - id: crc_errors
        type: u4
      - id: bus_errors
        type: u4
      - id: dropped
        type: u4
      - id: retries
        type: u4
  board_info:
    seq:
      - id: identity_who_am_i
        type: u1
      - id: identity_map_version
        type: u1
      - id: identity_firmware_major
        type: u1
      - id: identity_firmware_minor
        type: u1
      - id: identity_firmware_patch
        type: u1
      - id: identity_kind
        type: u1
      - id: identity_address
        type: u1
      - id: identity_map_revision
        type: u1
      - id: identity_unique_id
        size: 8
      - id: identity_rows
        type: u1
      - id: identity_columns
        type: u1
      - id: identity_taxel_count
        type: u2
      - id: identity_snapshot_size
        type: u2
      - id: identity_crossing_map
        size: 32
      - id: identity_crc32
        type: u4
      - id: settings_sub_conversions
        type: u2
      - id: settings_sense_clock_divider
        type: u2
      - id: settings_modulator_clock_divider
        type: u1
      - id: settings_idac_code
        type: u1
      - id: settings_settle_cycles
        type: u2
  board_fault_report:
    seq:
      - id: address
        type: u1
      - id: fault
        type: u1
        enum: board_fault
      - id: cycle
        type: u2
      - id: hub_time_us
        type: u4
      - id: consecutive
        type: u2
  time_sync:
    seq:
      - id: address
        type: u1
      - id: board_time_us
        type: u4
      - id: hub_time_us
        type: u8
  log_header:
    seq:
      - id: level
        type: u1
        enum: log_level
      - id: code
        type: u2
      - id: hub_time_us
        type: u4
  reply_header:
    seq:
      - id: tag
        type: u1
      - id: command
        type: u1
        enum: command
      - id: status
        type: u1
  command_header:
    seq:
      - id: tag
        type: u1
      - id: command
        type: u1
        enum: command
  acknowledgement:
    seq:
      - id: address
        type: u1
      - id: key_frame
        type: u2
  start_arguments:
    seq:
      - id: flags
        type: u1
  set_rate_arguments:
    seq:
      - id: period_us
        type: u4
  enter_bootloader_arguments:
    seq:
      - id: key
        type: u4
  transfer_arguments:
    seq:
      - id: address
        type: u1
      - id: read_length
        type: u1
  set_scan_settings_arguments:
    seq:
      - id: address
        type: u1
      - id: settings_sub_conversions
        type: u2
      - id: settings_sense_clock_divider
        type: u2
      - id: settings_modulator_clock_divider
        type: u1
      - id: settings_idac_code
        type: u1
      - id: settings_settle_cycles
        type: u2
      - id: front_end
        type: u1
  get_board_info_arguments:
    seq:
      - id: address
        type: u1
  get_time_reply:
    seq:
      - id: hub_time_us
        type: u8
  compact_snapshot:
    params:
      - id: taxel_count
        type: u1
    seq:
      - id: header
        type: compact_header
      - id: timestamp_us
        type: u4
        if: width != 0
      - id: key_frame
        type: u2
        if: width == 0
      - id: timestamp_low
        size: 3
        if: width == 0
      - id: packed
        if: width != 0
        type:
          switch-on: width
          cases:
            1: packed_1(taxel_count)
            2: packed_2(taxel_count)
            3: packed_3(taxel_count)
            4: packed_4(taxel_count)
            5: packed_5(taxel_count)
            6: packed_6(taxel_count)
            7: packed_7(taxel_count)
            8: packed_8(taxel_count)
            9: packed_9(taxel_count)
            10: packed_10(taxel_count)
            11: packed_11(taxel_count)
            12: packed_12(taxel_count)
            13: packed_13(taxel_count)
            14: packed_14(taxel_count)
            15: packed_15(taxel_count)
            16: packed_16(taxel_count)
      - id: coded
        doc: coded counts of a delta frame, or zeros behind the packed counts
        size: _io.size - _io.pos - 4
      - id: crc32
        type: u4
    instances:
      width:
        value: header.format & 31
  packed_1:
    params:
      - id: taxel_count
        type: u1
    seq:
      - id: counts
        type: b1
        repeat: expr
        repeat-expr: taxel_count
  packed_2:
    params:
      - id: taxel_count
        type: u1
    seq:
      - id: counts
        type: b2
        repeat: expr
        repeat-expr: taxel_count
  packed_3:
    params:
      - id: taxel_count
        type: u1
    seq:
      - id: counts
        type: b3
        repeat: expr
        repeat-expr: taxel_count
  packed_4:
    params:
      - id: taxel_count
        type: u1
    seq:
      - id: counts
        type: b4
        repeat: expr
        repeat-expr: taxel_count
  packed_5:
    params:
      - id: taxel_count
        type: u1
    seq:
      - id: counts
        type: b5
        repeat: expr
        repeat-expr: taxel_count
  packed_6:
    params:
      - id: taxel_count
        type: u1
    seq:
      - id: counts
        type: b6
        repeat: expr
        repeat-expr: taxel_count
  packed_7:
    params:
      - id: taxel_count
        type: u1
    seq:
      - id: counts
        type: b7
        repeat: expr
        repeat-expr: taxel_count
  packed_8:
    params:
      - id: taxel_count
        type: u1
    seq:
      - id: counts
        type: b8
        repeat: expr
        repeat-expr: taxel_count
  packed_9:
    params:
      - id: taxel_count
        type: u1
    seq:
      - id: counts
        type: b9
        repeat: expr
        repeat-expr: taxel_count
  packed_10:
    params:
      - id: taxel_count
        type: u1
    seq:
      - id: counts
        type: b10
        repeat: expr
        repeat-expr: taxel_count
  packed_11:
    params:
      - id: taxel_count
        type: u1
    seq:
      - id: counts
        type: b11
        repeat: expr
        repeat-expr: taxel_count
  packed_12:
    params:
      - id: taxel_count
        type: u1
    seq:
      - id: counts
        type: b12
        repeat: expr
        repeat-expr: taxel_count
  packed_13:
    params:
      - id: taxel_count
        type: u1
    seq:
      - id: counts
        type: b13
        repeat: expr
        repeat-expr: taxel_count
  packed_14:
    params:
      - id: taxel_count
        type: u1
    seq:
      - id: counts
        type: b14
        repeat: expr
        repeat-expr: taxel_count
  packed_15:
    params:
      - id: taxel_count
        type: u1
    seq:
      - id: counts
        type: b15
        repeat: expr
        repeat-expr: taxel_count
  packed_16:
    params:
      - id: taxel_count
        type: u1
    seq:
      - id: counts
        type: b16
        repeat: expr
        repeat-expr: taxel_count
enums:
  frame_type:
    1: hub_handshake
    2: taxels
    3: compact_taxels
    8: hub_status
    9: board_status
    10: board_info
    11: board_fault
    12: time_sync
    13: log
    14: reply
    129: host_handshake
    130: command
    131: acknowledge
  command:
    1: start
    2: stop
    3: set_rate
    4: scan_bus
    5: i2c_transfer
    6: set_scan_settings
    7: reboot
    8: get_status
    9: get_board_info
    10: get_time
    11: enter_bootloader
    12: get_fault
  start_flag:
    1: compact
  reply_status:
    0: ok
    1: unknown_command
    2: bad_arguments
    3: busy
    4: no_handshake
    5: unknown_board
    6: nack
    7: timeout
    8: bus_error
    9: rejected_by_board
  board_state:
    0: absent
    1: identifying
    2: streaming
    3: incompatible
  board_fault:
    0: none
    1: nack
    2: timeout
    3: crc
    4: sda_stuck
    5: scl_stuck
    6: arbitration
    7: not_a_taxel_board
    8: map_version
    9: restarted
    10: too_large
    11: settings_rejected
    12: recovered
  reset_cause:
    0: power_on
    1: brown_out
    2: watchdog
    3: command
  log_level:
    0: debug
    1: info
    2: warning
    3: error
  log_code:
    1: bus_free
    2: sda_stuck
    3: scl_stuck
    4: receive_overrun
    5: frame_dropped
  board_command:
    1: start_scan
    2: stop_scan
    3: clear_counters
    4: restart
    5: enter_bootloader
  board_error_flag:
    1: settings_rejected
    2: command_rejected
    8: saturated
    16: read_only_write
    32: not_scanning
  front_end:
    0: capsense
  fault_code:
    0: none
    1: exception
    2: not_scanning
