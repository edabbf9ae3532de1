/* The decoder for the original hub decodes protocol/vectors/original.json, in pieces of any size, and keeps to the
 * bounds of its buffer. Argument: the path of the file. */
#include <stdlib.h>

#include "check.h"
#include "codec/original.h"
#include "json_reader.h"

#define STREAM_MAX 4096u
#define MESSAGES_MAX 64u
#define WORDS_MAX 126u

struct decoded {
    struct taxel_original_message message;
    uint16_t words[WORDS_MAX];
};

static struct json_node *root;
static struct decoded decoded[MESSAGES_MAX];
static size_t decoded_count;
static struct taxel_original_decoder decoder;
static uint8_t *buffer; /* of exact size, so that a sanitizer detects an access behind it */

/* Store a decoded message and its words; handler of the decoder. */
static void on_message(void *context, const struct taxel_original_message *message)
{
    (void)context;
    if (CHECK(decoded_count < MESSAGES_MAX)) {
        struct decoded *slot = &decoded[decoded_count++];
        slot->message = *message;
        for (size_t i = 0; i < (size_t)message->taxel_count + message->acceleration_count; i++) {
            slot->words[i] = taxel_original_word(message, i);
        }
    }
}

/* Return the message format with this name, or NULL. */
static const struct taxel_original_format *format_named(const struct json_node *name)
{
#define SELECT(format, ...) \
    if (json_is(name, #format)) { \
        return &taxel_format_##format; \
    }
    TAXEL_ORIGINAL_FORMATS(SELECT)
#undef SELECT
    return NULL;
}

/* Decode a whole stream in pieces of `piece` bytes with a buffer of the smallest size. */
static void decode(const struct taxel_original_format *format, const uint8_t *bytes, size_t size, size_t piece)
{
    const struct taxel_original_config config = {
        .buffer = buffer,
        .capacity = TAXEL_ORIGINAL_BUFFER_MIN,
        .format = format,
        .handler = on_message,
        .context = NULL,
    };
    decoded_count = 0;
    CHECK_EQUAL(taxel_original_init(&decoder, &config), 0);
    for (size_t at = 0; at < size; at += piece) {
        taxel_original_push(&decoder, bytes + at, piece < size - at ? piece : size - at);
    }
    taxel_original_finish(&decoder);
}

/* Return the number in the member `name` of an object, which must exist. */
static uint64_t number_of(const struct json_node *object, const char *name)
{
    const struct json_node *value = json_member(object, name);
    CHECK(value);
    return value ? value->number : UINT64_MAX;
}

/* Check that the first `array->count` words equal the numbers of a JSON array. */
static void check_words(const uint16_t *words, const struct json_node *array)
{
    for (size_t i = 0; i < array->count; i++) {
        CHECK_EQUAL(words[i], json_at(array, i)->number);
    }
}

/* Check a message vector: its length and the decoded content, for several sizes of pieces. */
static void check_message(const struct json_node *vector)
{
    uint8_t wire[256];
    size_t size = 0;
    const struct taxel_original_format *format = format_named(json_member(vector, "format"));
    const struct json_node *counts = json_member(vector, "counts");
    const struct json_node *accelerations = json_member(vector, "accelerations");
    if (!CHECK(format && json_hex(json_member(vector, "wire"), wire, sizeof wire, &size))) {
        return;
    }
    const uint8_t address = (uint8_t)number_of(vector, "address");
    CHECK_EQUAL(taxel_original_length(format, address), size);
    for (size_t piece = 1; piece <= size; piece += 7u) {
        decode(format, wire, size, piece);
        if (CHECK_EQUAL(decoded_count, 1)) {
            const struct decoded *first = &decoded[0];
            CHECK_EQUAL(first->message.address, address);
            CHECK_EQUAL(first->message.timestamp_ms, number_of(vector, "timestamp_ms"));
            CHECK_EQUAL(first->message.taxel_count, counts->count);
            CHECK_EQUAL(first->message.acceleration_count, accelerations->count);
            check_words(first->words, counts);
            check_words(first->words + counts->count, accelerations);
        }
    }
}

/* Check a stream vector: accepted messages and counters, for several sizes of pieces. */
static void check_stream(const struct json_node *vector)
{
    static uint8_t stream[STREAM_MAX];
    size_t size = 0;
    const struct taxel_original_format *format = format_named(json_member(vector, "format"));
    const struct json_node *accepted = json_member(vector, "accepted");
    const struct json_node *plausible = json_member(vector, "plausible");
    if (!CHECK(format && json_hex(json_member(vector, "stream"), stream, sizeof stream, &size))) {
        return;
    }
    for (size_t piece = 1; piece <= size; piece = piece * 3u + 1u) {
        decode(format, stream, size, piece);
        CHECK_EQUAL(decoded_count, accepted->count);
        for (size_t i = 0; i < decoded_count && i < accepted->count; i++) {
            CHECK_EQUAL(decoded[i].message.position, json_at(accepted, i)->number);
            CHECK_EQUAL(decoded[i].message.is_time_plausible, json_at(plausible, i)->number);
        }
        CHECK_EQUAL(decoder.messages, accepted->count);
        CHECK_EQUAL(decoder.discarded_bytes, number_of(vector, "discarded_bytes"));
        CHECK_EQUAL(decoder.rejected_candidates, number_of(vector, "rejected_candidates"));
        CHECK_EQUAL(decoder.ambiguous_candidates, number_of(vector, "ambiguous_candidates"));
        CHECK_EQUAL(decoder.covered, size);
    }
}

static void every_message_of_the_vectors_is_decoded(void)
{
    const struct json_node *messages = json_member(root, "messages");
    CHECK(messages && messages->count);
    for (size_t i = 0; messages && i < messages->count; i++) {
        check_message(json_at(messages, i));
    }
}

static void every_stream_of_the_vectors_gives_the_same_messages_in_pieces_of_any_size(void)
{
    const struct json_node *streams = json_member(root, "streams");
    CHECK(streams && streams->count);
    for (size_t i = 0; streams && i < streams->count; i++) {
        check_stream(json_at(streams, i));
    }
}

static void a_small_buffer_and_a_too_long_message_are_rejected(void)
{
    static struct taxel_original_format format;
    struct taxel_original_config config = {
        .buffer = buffer,
        .capacity = TAXEL_ORIGINAL_BUFFER_MIN - 1u,
        .format = &format,
        .handler = on_message,
    };
    format.taxels[0x20] = 125;
    CHECK_EQUAL(taxel_original_init(&decoder, &config), -1);
    config.capacity++;
    CHECK_EQUAL(taxel_original_init(&decoder, &config), 0); /* without a timestamp: 254 bytes */
    format.has_timestamp = true;
    CHECK_EQUAL(taxel_original_init(&decoder, &config), -1);
}

/* The largest number of bytes that can wait: a candidate of the largest size, a second candidate that begins in the
 * last bytes of the first, and the header that decides between them. */
static void two_overlapping_messages_of_the_largest_size_fit_the_buffer(void)
{
    static struct taxel_original_format format;
    static uint8_t stream[TAXEL_ORIGINAL_BUFFER_MIN];
    const uint8_t address = 0x0A; /* the address of the second message is the end of the first */
    format.taxels[address] = 125;
    const size_t length = taxel_original_length(&format, address);
    const size_t second = length - 3u;
    memset(stream, 0x55, sizeof stream);
    memcpy(stream, (const uint8_t[]){0x01, (uint8_t)length, address}, 3);
    memcpy(stream + second, (const uint8_t[]){0x01, (uint8_t)length, address}, 3);
    stream[second + length - 1u] = 0x0A;
    memcpy(stream + second + length, (const uint8_t[]){0x01, (uint8_t)length, address}, 3);
    decode(&format, stream, second + length + 3u, second + length + 3u);
    CHECK_EQUAL(decoded_count, 1);
    CHECK_EQUAL(decoded[0].message.position, second);
    CHECK_EQUAL(decoder.ambiguous_candidates, 1);
}

/* Read the JSON file into memory and parse it. Returns false if this is not possible. */
static bool load(const char *path)
{
    FILE *file = fopen(path, "rb");
    if (!file || fseek(file, 0, SEEK_END)) {
        return false;
    }
    const long size = ftell(file);
    rewind(file);
    char *text = malloc((size_t)size + 1u);
    const size_t capacity = json_nodes_max((size_t)size);
    root = calloc(capacity, sizeof *root);
    const bool is_read = text && root && fread(text, 1, (size_t)size, file) == (size_t)size;
    (void)fclose(file);
    return is_read && !json_read(text, (size_t)size, root, capacity).message;
}

int main(int argc, char **argv)
{
    buffer = malloc(TAXEL_ORIGINAL_BUFFER_MIN);
    if (argc != 2 || !buffer || !load(argv[1])) {
        (void)fprintf(stderr, "usage: test_original ORIGINAL.json (a readable file)\n");
        return 1;
    }
    RUN(every_message_of_the_vectors_is_decoded);
    RUN(every_stream_of_the_vectors_gives_the_same_messages_in_pieces_of_any_size);
    RUN(a_small_buffer_and_a_too_long_message_are_rejected);
    RUN(two_overlapping_messages_of_the_largest_size_fit_the_buffer);
    return check_summary();
}
