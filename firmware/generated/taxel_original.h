/* Generated from taxel_protocol by tools/codegen/original_header.py (make generate). Do not edit. */
#ifndef TAXEL_ORIGINAL_H
#define TAXEL_ORIGINAL_H

#define TAXEL_ORIGINAL_START 0x01u
#define TAXEL_ORIGINAL_END 0x0Au
#define TAXEL_ORIGINAL_HEADER_SIZE 0x03u
#define TAXEL_ORIGINAL_TIMESTAMP_SIZE 0x04u
#define TAXEL_ORIGINAL_ADDRESSES 128u
#define TAXEL_ORIGINAL_ACCELERATIONS 0x03u
#define TAXEL_ORIGINAL_RECORD_SIZE 50u
#define TAXEL_ORIGINAL_RECORD_ADDRESS 0x08u
#define TAXEL_ORIGINAL_REFERENCE_TIMES 0x04u
#define TAXEL_ORIGINAL_TIME_STEP_MAX_MS 60000u

#define TAXEL_ORIGINAL_BOARDS(X) \
    X(0x08, 65, 0) \
    X(0x09, 30, 0) \
    X(0x0A, 78, 0) \
    X(0x0B, 66, 0) \
    X(0x0C, 27, 0) \
    X(0x0D, 65, 0) \
    X(0x0E, 30, 0) \
    X(0x0F, 78, 0) \
    X(0x10, 66, 0) \
    X(0x11, 31, 0) \
    X(0x12, 65, 0) \
    X(0x13, 47, 0) \
    X(0x14, 78, 0) \
    X(0x15, 121, 0) \
    X(0x16, 118, 0) \
    X(0x17, 66, 0) \
    X(0x18, 27, 0) \
    X(0x19, 65, 0) \
    X(0x1A, 30, 0) \
    X(0x1B, 78, 0) \
    X(0x1C, 66, 0) \
    X(0x1D, 27, 0)

#define TAXEL_ORIGINAL_ACCELERATIONS_BOARDS(X) \
    X(0x08, 65, 0) \
    X(0x09, 30, 0) \
    X(0x0A, 78, 0) \
    X(0x0B, 66, 3) \
    X(0x0C, 27, 0) \
    X(0x0D, 65, 0) \
    X(0x0E, 30, 0) \
    X(0x0F, 78, 0) \
    X(0x10, 66, 3) \
    X(0x11, 31, 0) \
    X(0x12, 65, 0) \
    X(0x13, 47, 0) \
    X(0x14, 78, 0) \
    X(0x15, 121, 0) \
    X(0x16, 118, 0) \
    X(0x17, 66, 3) \
    X(0x18, 27, 0) \
    X(0x19, 65, 0) \
    X(0x1A, 30, 0) \
    X(0x1B, 78, 0) \
    X(0x1C, 66, 3) \
    X(0x1D, 27, 0)

#define TAXEL_ORIGINAL_FIRST_GENERATION_BOARDS(X) \
    X(0x08, 6, 0) \
    X(0x09, 6, 0) \
    X(0x0A, 15, 0) \
    X(0x0B, 14, 0) \
    X(0x0C, 6, 0) \
    X(0x0D, 6, 0) \
    X(0x0E, 6, 0) \
    X(0x0F, 15, 0) \
    X(0x10, 14, 0) \
    X(0x11, 6, 0) \
    X(0x12, 6, 0) \
    X(0x13, 6, 0) \
    X(0x14, 6, 0) \
    X(0x15, 20, 0) \
    X(0x16, 25, 0) \
    X(0x17, 14, 0) \
    X(0x18, 6, 0) \
    X(0x19, 6, 0) \
    X(0x1A, 6, 0) \
    X(0x1B, 15, 0) \
    X(0x1C, 14, 0) \
    X(0x1D, 6, 0)

#define TAXEL_ORIGINAL_FIRST_GENERATION_TEST_BOARDS(X) \
    X(0x08, 6, 0) \
    X(0x09, 6, 0) \
    X(0x0A, 15, 0) \
    X(0x0B, 14, 0) \
    X(0x0C, 6, 0) \
    X(0x0D, 6, 0) \
    X(0x0E, 6, 0) \
    X(0x0F, 15, 0) \
    X(0x10, 14, 0) \
    X(0x11, 6, 0) \
    X(0x12, 6, 0) \
    X(0x13, 6, 0) \
    X(0x14, 6, 0) \
    X(0x15, 20, 0) \
    X(0x16, 25, 0) \
    X(0x17, 14, 0) \
    X(0x18, 6, 0) \
    X(0x19, 6, 0) \
    X(0x1A, 6, 0) \
    X(0x1B, 15, 0) \
    X(0x1C, 14, 0) \
    X(0x1D, 6, 0)

#define TAXEL_ORIGINAL_FIRST_GENERATION_UNTIMED_BOARDS(X) \
    X(0x01, 14, 0) \
    X(0x02, 6, 0) \
    X(0x03, 6, 0) \
    X(0x04, 6, 0) \
    X(0x05, 15, 0) \
    X(0x06, 14, 0) \
    X(0x07, 6, 0) \
    X(0x08, 6, 0) \
    X(0x09, 6, 0) \
    X(0x0A, 15, 0) \
    X(0x0B, 14, 0) \
    X(0x0C, 6, 0) \
    X(0x0D, 6, 0) \
    X(0x0E, 6, 0) \
    X(0x0F, 15, 0) \
    X(0x10, 14, 0) \
    X(0x11, 6, 0) \
    X(0x12, 6, 0) \
    X(0x13, 6, 0) \
    X(0x14, 6, 0) \
    X(0x15, 20, 0) \
    X(0x16, 25, 0) \
    X(0x17, 14, 0) \
    X(0x18, 6, 0) \
    X(0x19, 6, 0) \
    X(0x1A, 6, 0) \
    X(0x1B, 15, 0) \
    X(0x1C, 14, 0) \
    X(0x1D, 6, 0)

#define TAXEL_ORIGINAL_FINGERTIP_RECORDS_BOARDS(X) \
    X(0x08, 25, 0)

/* Formats: X(name, macro of its boards, has_timestamp, is_big_endian, record_size). */
#define TAXEL_ORIGINAL_FORMATS(X) \
    X(original, TAXEL_ORIGINAL_BOARDS, 1, 0, 0) \
    X(original_accelerations, TAXEL_ORIGINAL_ACCELERATIONS_BOARDS, 1, 0, 0) \
    X(first_generation, TAXEL_ORIGINAL_FIRST_GENERATION_BOARDS, 1, 0, 0) \
    X(first_generation_test, TAXEL_ORIGINAL_FIRST_GENERATION_TEST_BOARDS, 1, 1, 0) \
    X(first_generation_untimed, TAXEL_ORIGINAL_FIRST_GENERATION_UNTIMED_BOARDS, 0, 0, 0) \
    X(fingertip_records, TAXEL_ORIGINAL_FINGERTIP_RECORDS_BOARDS, 0, 0, 50)

#endif
