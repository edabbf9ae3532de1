meta:
  id: taxel_capture
  title: Capture file of a taxel hub
  file-extension: bin
  license: MIT
  endian: le
doc: |
  Bytes of one direction of one wire, with the times of their arrival. The bytes of all records in their order are the
  input of taxel_stream.ksy.
doc-ref: protocol/SPEC.md, part 4
seq:
  - id: magic
    contents: TAXELCAP
  - id: version
    type: u2
    valid: 1
  - id: reserved
    type: u2
  - id: len_header
    type: u4
  - id: header
    doc: one JSON object
    size: len_header
    type: str
    encoding: UTF-8
  - id: records
    type: record
    repeat: eos
types:
  record:
    seq:
      - id: time_ns
        type: u8
      - id: len_bytes
        type: u4
      - id: bytes
        size: len_bytes
