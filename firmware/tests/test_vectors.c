/* Compare the C codec with the golden vectors. Arguments: FRAMES.json REGISTERS.json DAMAGED.json (any of them, in any
 * order). Prints the name of each vector that fails and a line with the numbers of passed and failed checks. The exit
 * status is 0 only if all checks passed. */
#include <stdio.h>
#include <stdlib.h>

#include "codec/crc32.h"
#include "codec/deframer.h"
#include "codec/encoder.h"
#include "tests/generated_fields.h"
#include "tests/json_reader.h"

#define STREAM_MAX 16384u
#define WIRE_MAX (TAXEL_ENCODED_MAX + 2u)
#define CHUNK_MAX (2u * WIRE_MAX)
#define STRUCT_MAX 256u
#define HUB_PAYLOAD_MAX 68u /* longest payload to the hub */

static unsigned passed, failed;

/* A struct of any of the generated types. */
union any_struct {
    uint64_t alignment;
    uint8_t bytes[STRUCT_MAX];
};

struct bytes {
    uint8_t data[STREAM_MAX];
    size_t size;
};

/* Count a check of a vector as passed or failed; a failed check is printed with the name of the vector. */
static void count_check(const struct json_node *vector, const char *description, bool is_right)
{
    const struct json_node *name = json_member(vector, "name");
    if (is_right) {
        passed++;
        return;
    }
    failed++;
    printf("failed: %.*s: %s\n", name ? (int)name->length : 0, name ? name->text : "", description);
}

/* Return the number in the member `name` of an object; 0 if there is none. */
static uint64_t number_of(const struct json_node *object, const char *name)
{
    const struct json_node *node = json_member(object, name);
    return node && (node->kind == JSON_NUMBER || node->kind == JSON_BOOL) ? node->number : 0;
}

/* Read the bytes of the hexadecimal member `name` of an object. Returns false if it is missing or invalid. */
static bool hex_of(const struct json_node *object, const char *name, struct bytes *bytes)
{
    return json_hex(json_member(object, name), bytes->data, sizeof bytes->data, &bytes->size);
}

/* Return whether `a` equals the `size` bytes of data. */
static bool are_equal(const struct bytes *a, const uint8_t *data, size_t size)
{
    return a->size == size && memcmp(a->data, data, size) == 0;
}

/* ---- fields to bytes, through the generated structs ---- */

/* Return the layout (list of fields) of the packed struct with this name, or NULL. */
static const struct layout *layout_named(const char *name, size_t length)
{
    for (size_t i = 0; i < sizeof layouts / sizeof layouts[0]; i++) {
        if (strlen(layouts[i].name) == length && memcmp(layouts[i].name, name, length) == 0) {
            return &layouts[i];
        }
    }
    return NULL;
}

/* Store a number in a struct member of `size` bytes. Returns false if it does not fit. */
static bool store_number(uint8_t *member, size_t size, uint64_t number)
{
    const uint8_t u8 = (uint8_t)number;
    const uint16_t u16 = (uint16_t)number;
    const uint32_t u32 = (uint32_t)number;
    if (size < sizeof number && number >> (8u * size)) {
        return false;
    }
    memcpy(member,
           size == 1   ? (const void *)&u8
           : size == 2 ? (const void *)&u16
           : size == 4 ? (const void *)&u32
                       : &number,
           size);
    return true;
}

/* Store the value of one field of a vector in the C struct. Returns false if the field is missing or does not
 * fit. */
static bool store_field(const struct field *field, const char *prefix, const struct json_node *fields, uint8_t *value)
{
    char name[80];
    size_t size = 0;
    if (snprintf(name, sizeof name, "%s%s", prefix, field->name) >= (int)sizeof name) {
        return false;
    }
    const struct json_node *node = json_member(fields, name);
    if (!node) {
        return false;
    }
    if (field->is_bytes) {
        return json_hex(node, value + field->offset, field->size, &size) && size == field->size;
    }
    return node->kind == JSON_NUMBER && store_number(value + field->offset, field->size, node->number);
}

/* Append the packed struct with the field values of a vector to `out`. Also unpack and pack it again, which must give
 * the same bytes. Returns false on an error. */
static bool append_struct(const struct layout *layout, const char *prefix, const struct json_node *fields,
                          struct bytes *out)
{
    union any_struct value = {0};
    union any_struct copy = {0};
    uint8_t again[STRUCT_MAX];
    if (!layout || !fields || out->size + layout->size > sizeof out->data) {
        return false;
    }
    for (size_t i = 0; i < layout->field_count; i++) {
        if (!store_field(&layout->fields[i], prefix, fields, value.bytes)) {
            return false;
        }
    }
    layout->pack(value.bytes, out->data + out->size);
    layout->unpack(copy.bytes, out->data + out->size);
    layout->pack(copy.bytes, again);
    const bool same = memcmp(again, out->data + out->size, layout->size) == 0;
    out->size += layout->size;
    return same;
}

/* Append the raw counts of a vector, 2 bytes each. Returns false if there are none or too many. */
static bool append_counts(const struct json_node *vector, struct bytes *out)
{
    const struct json_node *counts = json_member(vector, "counts");
    if (!counts || counts->count > TAXEL_TAXELS_MAX) {
        return false;
    }
    for (size_t i = 0; i < counts->count; i++) {
        taxel_put_u16(out->data + out->size, (uint16_t)json_at(counts, i)->number);
        out->size += 2u;
    }
    return true;
}

/* Return the CRC-32 of the board's address followed by `size` bytes. */
static uint32_t board_crc(uint8_t address, const uint8_t *bytes, size_t size)
{
    return taxel_crc32(taxel_crc32(0, &address, 1), bytes, size);
}

/* Append the bytes of the hexadecimal member `name` of an object. Returns false if it is invalid. */
static bool append_hex(const struct json_node *object, const char *name, struct bytes *out)
{
    size_t size = 0;
    if (!json_hex(json_member(object, name), out->data + out->size, sizeof out->data - out->size, &size)) {
        return false;
    }
    out->size += size;
    return true;
}

/* Append the bytes of a vector after its fields: a nested struct, or hexadecimal bytes. Returns false on an
 * error. */
static bool append_tail(const struct json_node *vector, struct bytes *out)
{
    const struct json_node *inner = json_member(vector, "inner");
    if (!inner) {
        return append_hex(vector, "tail", out);
    }
    const struct json_node *name = json_member(inner, "struct");
    return name && append_struct(layout_named(name->text, name->length), "", json_member(inner, "fields"), out) &&
           append_hex(inner, "tail", out);
}

/* Build the payload of a frame from the fields of a vector, with the generated C code. Returns false on an
 * error. */
static bool build_payload(const struct json_node *vector, struct bytes *out)
{
    const struct json_node *fields = json_member(vector, "fields");
    const uint64_t type = number_of(vector, "type");
    out->size = 0;
    for (size_t i = 0; i < sizeof payload_parts / sizeof payload_parts[0]; i++) {
        const struct payload_part *part = &payload_parts[i];
        if (part->type == type &&
            !append_struct(layout_named(part->layout, strlen(part->layout)), part->prefix, fields, out)) {
            return false;
        }
    }
    if (type != TAXEL_FRAME_TYPE_TAXELS) {
        return append_tail(vector, out);
    }
    if (!append_counts(vector, out)) {
        return false;
    }
    const uint8_t *snapshot = out->data + TAXEL_TAXEL_HEADER_SIZE;
    const uint32_t right = board_crc(out->data[0], snapshot, out->size - TAXEL_TAXEL_HEADER_SIZE);
    const uint32_t crc = (uint32_t)number_of(fields, "snapshot_crc32");
    taxel_put_u32(out->data + out->size, crc);
    out->size += 4u;
    return (crc == right) == (number_of(vector, "board_crc_ok") != 0);
}

/* ---- encoding ---- */

/* Encode the frame of a vector into a ring buffer from position `start` on, with the payload in two parts. Returns
 * the encoded size. */
static size_t encode(const struct json_node *vector, const struct bytes *payload, uint8_t *ring, size_t capacity,
                     size_t start)
{
    struct taxel_encoder encoder;
    const size_t half = payload->size / 2u;
    taxel_encoder_begin(&encoder, ring, capacity, start, (uint8_t)number_of(vector, "type"),
                        (uint16_t)number_of(vector, "sequence"), (uint16_t)payload->size);
    taxel_encoder_put(&encoder, payload->data, half);
    taxel_encoder_put(&encoder, payload->data + half, payload->size - half);
    return taxel_encoder_end(&encoder);
}

/* Return whether a frame is encoded to the bytes of the vector in a ring buffer that wraps at each position of the
 * frame in turn. */
static bool encodes_in_any_ring(const struct json_node *vector, const struct bytes *payload, const struct bytes *wire)
{
    uint8_t ring[WIRE_MAX];
    uint8_t straight[WIRE_MAX];
    const size_t capacity = taxel_encoded_size_max(payload->size);
    for (size_t start = 0; start < capacity; start++) {
        const size_t size = encode(vector, payload, ring, capacity, start);
        for (size_t i = 0; i < size; i++) {
            straight[i] = ring[(start + i) % capacity];
        }
        if (!are_equal(wire, straight, size)) {
            return false;
        }
    }
    return true;
}

/* ---- decoding ---- */

/* The frames that a stream must yield, in order. */
struct expectation {
    const struct json_node *sent;
    const struct json_node *expected;
    size_t frame_count;
    bool is_right;
};

/* Compare a frame with the next expected frame of a stream vector; handler of the deframer. */
static void compare_frame(void *context, const struct taxel_frame *frame)
{
    static struct bytes payload;
    struct expectation *expectation = context;
    const struct json_node *index = json_at(expectation->expected, expectation->frame_count++);
    const struct json_node *sent = index ? json_at(expectation->sent, (size_t)index->number) : NULL;
    if (!sent || number_of(sent, "type") != frame->type || number_of(sent, "sequence") != frame->sequence ||
        !hex_of(sent, "payload", &payload) || !are_equal(&payload, frame->payload, frame->length)) {
        expectation->is_right = false;
    }
}

/* Decode a stream in pieces of `piece` bytes. Returns whether exactly the expected frames were found. */
static bool decodes(const struct json_node *vector, const struct bytes *stream, size_t piece, uint16_t payload_max)
{
    static uint8_t chunk[CHUNK_MAX];
    static uint8_t body[TAXEL_BODY_MAX];
    struct expectation expectation = {json_member(vector, "sent"), json_member(vector, "expected"), 0, true};
    struct taxel_deframer deframer;
    const struct taxel_deframer_config config = {
        .chunk = chunk,
        .chunk_capacity = 2u * taxel_encoded_size_max(payload_max),
        .body = body,
        .payload_max = payload_max,
        .directions = (uint8_t)number_of(vector, "directions"),
        .handler = compare_frame,
        .context = &expectation,
    };
    taxel_deframer_init(&deframer, &config);
    for (size_t done = 0; done < stream->size; done += piece) {
        const size_t remaining = stream->size - done;
        taxel_deframer_push(&deframer, stream->data + done, remaining < piece ? remaining : piece);
    }
    taxel_deframer_finish(&deframer);
    /* a receiver of shorter payloads cannot check the CRC of a longer unknown frame */
    const bool counts_unknown =
        payload_max < TAXEL_PAYLOAD_MAX || deframer.unknown_frames == number_of(vector, "unknown");
    return expectation.is_right && expectation.frame_count == expectation.expected->count && counts_unknown &&
           deframer.position == stream->size;
}

struct decoded_frame {
    const struct json_node *vector;
    const struct bytes *payload;
    unsigned frame_count;
    bool is_right;
};

/* Compare a frame with the only expected frame; handler of the deframer. */
static void compare_one_frame(void *context, const struct taxel_frame *frame)
{
    struct decoded_frame *decoded = context;
    decoded->frame_count++;
    decoded->is_right = frame->type == number_of(decoded->vector, "type") &&
                        frame->sequence == number_of(decoded->vector, "sequence") &&
                        are_equal(decoded->payload, frame->payload, frame->length);
}

/* Decode the bytes of one frame vector. Returns whether the same frame, and no other, was found. */
static bool decodes_to_itself(const struct json_node *vector, const struct bytes *payload, const struct bytes *wire)
{
    static uint8_t chunk[CHUNK_MAX];
    static uint8_t body[TAXEL_BODY_MAX];
    struct decoded_frame decoded = {.vector = vector, .payload = payload};
    struct taxel_deframer deframer;
    const struct taxel_deframer_config config = {
        .chunk = chunk,
        .chunk_capacity = sizeof chunk,
        .body = body,
        .payload_max = TAXEL_PAYLOAD_MAX,
        .directions = TAXEL_DIRECTION_TO_HOST | TAXEL_DIRECTION_TO_HUB,
        .handler = compare_one_frame,
        .context = &decoded,
    };
    taxel_deframer_init(&deframer, &config);
    taxel_deframer_push(&deframer, wire->data, wire->size);
    return decoded.is_right && decoded.frame_count == 1 && deframer.discarded_bytes == 0;
}

/* ---- one vector of each kind ---- */

/* Check a frame vector: packing, encoding and decoding. */
static void check_frame(const struct json_node *vector)
{
    static struct bytes payload, wire, built;
    if (!hex_of(vector, "payload", &payload) || !hex_of(vector, "wire", &wire)) {
        count_check(vector, "has no payload or wire bytes", false);
        return;
    }
    count_check(vector, "packing its fields gives other bytes",
                build_payload(vector, &built) && are_equal(&payload, built.data, built.size));
    count_check(vector, "encoding its payload gives other bytes", encodes_in_any_ring(vector, &payload, &wire));
    count_check(vector, "decoding its wire bytes gives another frame", decodes_to_itself(vector, &payload, &wire));
}

/* Build the content of a register from the fields of a vector, with the generated C code. Returns false on an
 * error. */
static bool build_register(const struct json_node *vector, struct bytes *out)
{
    const struct json_node *name = json_member(vector, "struct");
    out->size = 0;
    if (!name || !append_struct(layout_named(name->text, name->length), "", json_member(vector, "fields"), out)) {
        return false;
    }
    if (json_is(name, "snapshot_header")) {
        if (!append_counts(vector, out)) {
            return false;
        }
        taxel_put_u32(out->data + out->size, (uint32_t)number_of(vector, "crc32"));
        out->size += 4u;
    }
    return true;
}

/* Return whether the CRC in the content of a register is right; true if the register has none. */
static bool register_crc_is_right(const struct json_node *vector, const struct bytes *bytes)
{
    const struct json_node *name = json_member(vector, "struct");
    if (!json_is(name, "identity") && !json_member(vector, "address")) {
        return true; /* status and command have no CRC */
    }
    const uint32_t stored = taxel_get_u32(bytes->data + bytes->size - 4u);
    if (json_is(name, "identity")) {
        return stored == taxel_crc32(0, bytes->data, bytes->size - 4u);
    }
    return stored == board_crc((uint8_t)number_of(vector, "address"), bytes->data, bytes->size - 4u);
}

/* Check a register vector: packing and CRC. */
static void check_register(const struct json_node *vector)
{
    static struct bytes bytes, built;
    const bool whole = hex_of(vector, "bytes", &bytes) && bytes.size >= TAXEL_COMMAND_REGISTER_SIZE;
    count_check(vector, "packing its fields gives other bytes",
                whole && build_register(vector, &built) && are_equal(&bytes, built.data, built.size));
    count_check(vector, "its CRC is another", whole && register_crc_is_right(vector, &bytes));
}

/* Check a stream vector: the frames found in damaged bytes, for several sizes of pieces. */
static void check_stream(const struct json_node *vector)
{
    static struct bytes stream;
    static const size_t pieces[] = {1, 64, STREAM_MAX};
    if (!hex_of(vector, "stream", &stream)) {
        count_check(vector, "its stream is no hexadecimal string, or too long", false);
        return;
    }
    for (size_t i = 0; i < sizeof pieces / sizeof pieces[0]; i++) {
        count_check(vector, "other frames came out", decodes(vector, &stream, pieces[i], TAXEL_PAYLOAD_MAX));
        if (number_of(vector, "directions") == TAXEL_DIRECTION_TO_HUB) {
            count_check(vector, "other frames came out at the hub",
                        decodes(vector, &stream, pieces[i], HUB_PAYLOAD_MAX));
        }
    }
}

/* ---- files ---- */

/* Call `check` for each vector of an array. */
static void check_each(const struct json_node *vectors, void (*check)(const struct json_node *vector))
{
    if (!vectors || vectors->kind != JSON_ARRAY) {
        return;
    }
    const struct json_node *vector = vectors + 1;
    for (size_t i = 0; i < vectors->count; i++) {
        check(vector);
        vector += vector->span;
    }
}

/* Read a file into memory, which the caller frees. Returns NULL on an error. */
static char *read_text(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    if (!file) {
        return NULL;
    }
    char *text = NULL;
    if (fseek(file, 0, SEEK_END) == 0) {
        const long end = ftell(file);
        *size = end > 0 ? (size_t)end : 0;
        rewind(file);
        text = malloc(*size + 1u);
        if (text && fread(text, 1, *size, file) != *size) {
            free(text);
            text = NULL;
        }
    }
    fclose(file);
    return text;
}

/* Check all vectors of one JSON file. Returns 0, or -1 if it cannot be read. */
static int check_file(const char *path)
{
    size_t size = 0;
    char *text = read_text(path, &size);
    struct json_node *nodes = text ? malloc(json_nodes_max(size) * sizeof *nodes) : NULL;
    if (!nodes) {
        fprintf(stderr, "%s: cannot be read\n", path);
        free(text);
        return -1;
    }
    const struct json_error error = json_read(text, size, nodes, json_nodes_max(size));
    const unsigned before = passed + failed;
    if (!error.message) {
        check_each(json_member(nodes, "frames"), check_frame);
        check_each(json_member(nodes, "registers"), check_register);
        check_each(json_member(nodes, "streams"), check_stream);
    }
    const bool has_vectors = passed + failed > before;
    if (error.message || !has_vectors) {
        fprintf(stderr, "%s: byte %zu: %s\n", path, error.position,
                error.message ? error.message : "the file contains no vectors");
    }
    free(nodes);
    free(text);
    return error.message || !has_vectors ? -1 : 0;
}

/* Check all vectors of the JSON files whose paths are the arguments. The exit status is 1 after a failure or without
 * arguments. */
int main(int argument_count, char **arguments)
{
    int status = argument_count > 1 ? 0 : 1;
    if (status) {
        fprintf(stderr, "usage: test_vectors FRAMES.json REGISTERS.json DAMAGED.json\n");
    }
    for (int i = 1; i < argument_count; i++) {
        if (check_file(arguments[i])) {
            status = 1;
        }
    }
    printf("%u passed, %u failed\n", passed, failed);
    return status || failed ? 1 : 0;
}
