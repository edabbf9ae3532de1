meta:
  id: taxel_original
  title: Message of the original hub
  license: MIT
  endian: le
doc: |
  One message of the original hub of the thesis. The parameters describe its variant and its board. The search for
  messages in a stream, which compares overlapping candidates, cannot be described.
doc-ref: protocol/SPEC.md, part 7
params:
  - id: taxel_count
    type: u1
  - id: acceleration_count
    type: u1
  - id: is_framed
    type: bool
  - id: has_timestamp
    type: bool
  - id: is_big_endian
    type: bool
seq:
  - id: start
    contents: [0x01]
    if: is_framed
  - id: length
    type: u1
    if: is_framed
  - id: address
    type: u1
    if: is_framed
  - id: timestamp_ms
    type: u4be
    if: has_timestamp
  - id: counts
    type:
      switch-on: is_big_endian
      cases:
        true: u2be
        false: u2le
    repeat: expr
    repeat-expr: taxel_count
  - id: accelerations
    type:
      switch-on: is_big_endian
      cases:
        true: s2be
        false: s2le
    repeat: expr
    repeat-expr: acceleration_count
  - id: end
    contents: [0x0A]
    if: is_framed
