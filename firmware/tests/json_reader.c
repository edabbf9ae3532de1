#include "tests/json_reader.h"

#include <string.h>

/* State of the parser. */
struct reader {
    const char *text;
    size_t size;
    size_t position;
    struct json_node *nodes;
    size_t capacity;
    size_t used;
    unsigned depth;
    const char *error;
};

/* Store the first error message of the reader. Returns false. */
static bool fail(struct reader *reader, const char *message)
{
    if (!reader->error) {
        reader->error = message;
    }
    return false;
}

/* Return the next character of the text, or -1 at its end. */
static int peek(const struct reader *reader)
{
    return reader->position < reader->size ? (unsigned char)reader->text[reader->position] : -1;
}

/* Move the reader behind white space. */
static void skip_space(struct reader *reader)
{
    while (peek(reader) == ' ' || peek(reader) == '\n' || peek(reader) == '\r' || peek(reader) == '\t') {
        reader->position++;
    }
}

/* Skip white space and take the expected character. Returns false, and takes nothing, if another character follows. */
static bool take(struct reader *reader, char expected)
{
    skip_space(reader);
    if (peek(reader) != expected) {
        return false;
    }
    reader->position++;
    return true;
}

/* Append a value of this kind to the array of nodes. Returns the node, or NULL if the array is full. */
static struct json_node *add_node(struct reader *reader, enum json_kind kind)
{
    if (reader->used == reader->capacity) {
        (void)fail(reader, "more values than the array of nodes can hold");
        return NULL;
    }
    struct json_node *node = &reader->nodes[reader->used++];
    memset(node, 0, sizeof *node);
    node->kind = kind;
    node->span = 1;
    return node;
}

/* Read a string of printable ASCII characters without escapes as a node. Returns false on an error. */
static bool read_string(struct reader *reader)
{
    struct json_node *node = add_node(reader, JSON_STRING);
    if (!node || !take(reader, '"')) {
        return fail(reader, "expected a string");
    }
    const size_t start = reader->position;
    while (peek(reader) >= ' ' && peek(reader) < 0x7F && peek(reader) != '"' && peek(reader) != '\\') {
        reader->position++;
    }
    node->text = reader->text + start;
    node->length = reader->position - start;
    if (peek(reader) != '"') {
        return fail(reader, "expected printable ASCII without escapes, and a closing quote");
    }
    reader->position++;
    return true;
}

/* Read a whole number without sign as a node. Returns false on an error or if it exceeds 64 bits. */
static bool read_number(struct reader *reader)
{
    struct json_node *node = add_node(reader, JSON_NUMBER);
    const size_t start = reader->position;
    if (!node) {
        return false;
    }
    while (peek(reader) >= '0' && peek(reader) <= '9') {
        const uint64_t digit = (uint64_t)(peek(reader) - '0');
        if (node->number > (UINT64_MAX - digit) / 10u) {
            return fail(reader, "a number is above 2^64 - 1");
        }
        node->number = 10u * node->number + digit;
        reader->position++;
    }
    const size_t digits = reader->position - start;
    if (digits == 0 || (digits > 1 && reader->text[start] == '0')) {
        return fail(reader, "expected a value");
    }
    if (peek(reader) == '.' || peek(reader) == 'e' || peek(reader) == 'E') {
        return fail(reader, "expected a whole number");
    }
    return true;
}

/* Read a word (true or false) as a node with this number. Returns false if another text follows. */
static bool read_word(struct reader *reader, const char *word, uint64_t number)
{
    const size_t length = strlen(word);
    struct json_node *node = add_node(reader, JSON_BOOL);
    if (!node || reader->size - reader->position < length ||
        memcmp(reader->text + reader->position, word, length) != 0) {
        return fail(reader, "expected a value");
    }
    node->number = number;
    reader->position += length;
    return true;
}

static bool read_value(struct reader *reader);

/* Read the members of an array or an object up to the character `end`. Returns false on an error. */
static bool read_members(struct reader *reader, enum json_kind kind, char end)
{
    const size_t index = reader->used;
    if (!add_node(reader, kind)) {
        return false;
    }
    reader->position++;
    if (!take(reader, end)) {
        do {
            if (kind == JSON_OBJECT && (!read_string(reader) || !take(reader, ':'))) {
                return fail(reader, "expected a name and a colon");
            }
            if (!read_value(reader)) {
                return false;
            }
            reader->nodes[index].count++;
        } while (take(reader, ','));
        if (!take(reader, end)) {
            return fail(reader, "expected a comma or the end of a list");
        }
    }
    reader->nodes[index].span = reader->used - index;
    return true;
}

/* Read one JSON value with all its members. Returns false on an error. */
static bool read_value(struct reader *reader)
{
    bool good;
    skip_space(reader);
    if (reader->depth == JSON_DEPTH_MAX) {
        return fail(reader, "values are nested too deeply");
    }
    reader->depth++;
    switch (peek(reader)) {
    case '{':
        good = read_members(reader, JSON_OBJECT, '}');
        break;
    case '[':
        good = read_members(reader, JSON_ARRAY, ']');
        break;
    case '"':
        good = read_string(reader);
        break;
    case 't':
        good = read_word(reader, "true", 1);
        break;
    case 'f':
        good = read_word(reader, "false", 0);
        break;
    default:
        good = read_number(reader);
        break;
    }
    reader->depth--;
    return good;
}

/* Return the largest number of nodes that a JSON text of `size` bytes can need. */
size_t json_nodes_max(size_t size)
{
    return size / 2u + 1u; /* each value has at least one byte and one separator */
}

/* Read a JSON text into an array of nodes. Returns the error with its position, or no error. */
struct json_error json_read(const char *text, size_t size, struct json_node *nodes, size_t capacity)
{
    struct reader reader = {.text = text, .size = size, .nodes = nodes, .capacity = capacity};
    if (read_value(&reader)) {
        skip_space(&reader);
        if (reader.position != size) {
            (void)fail(&reader, "expected the end of the text");
        }
    }
    return (struct json_error){.message = reader.error, .position = reader.position};
}

/* Return the value of the member `name` of an object, or NULL. */
const struct json_node *json_member(const struct json_node *object, const char *name)
{
    if (!object || object->kind != JSON_OBJECT) {
        return NULL;
    }
    const struct json_node *member = object + 1;
    for (size_t i = 0; i < object->count; i++) {
        if (json_is(member, name)) {
            return member + 1;
        }
        member += 1u + member[1].span;
    }
    return NULL;
}

/* Return the value with this index in an array, or NULL. */
const struct json_node *json_at(const struct json_node *array, size_t index)
{
    if (!array || array->kind != JSON_ARRAY || index >= array->count) {
        return NULL;
    }
    const struct json_node *value = array + 1;
    while (index--) {
        value += value->span;
    }
    return value;
}

/* Return whether the node is a string that equals `text`. */
bool json_is(const struct json_node *string, const char *text)
{
    return string && string->kind == JSON_STRING && string->length == strlen(text) &&
           memcmp(string->text, text, string->length) == 0;
}

/* Return the value of a lower-case hexadecimal digit, or -1. */
static int digit_of(char c)
{
    if (c >= '0' && c <= '9') {
        return c - '0';
    }
    return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

/* Convert a string of hexadecimal digits to bytes. Returns false if the node is not such a string, or if it is longer
 * than `capacity` bytes. */
bool json_hex(const struct json_node *string, uint8_t *bytes, size_t capacity, size_t *size)
{
    if (!string || string->kind != JSON_STRING || string->length % 2u || string->length / 2u > capacity) {
        return false;
    }
    *size = string->length / 2u;
    for (size_t i = 0; i < *size; i++) {
        const int high = digit_of(string->text[2u * i]);
        const int low = digit_of(string->text[2u * i + 1u]);
        if (high < 0 || low < 0) {
            return false;
        }
        bytes[i] = (uint8_t)(16 * high + low);
    }
    return true;
}
