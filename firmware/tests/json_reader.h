/* A strict reader for the JSON that the vectors are written in: objects, arrays, strings without escapes, unsigned whole
 * numbers, true and false. Anything else is an error. Never allocates: nodes and text are the caller's. */
#ifndef TAXEL_TESTS_JSON_READER_H
#define TAXEL_TESTS_JSON_READER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define JSON_DEPTH_MAX 16u

enum json_kind {
    JSON_OBJECT,
    JSON_ARRAY,
    JSON_STRING,
    JSON_NUMBER,
    JSON_BOOL,
};

/* Nodes lie in the order of the text: a node is followed by its children, an object's by turns a name and a value. */
struct json_node {
    enum json_kind kind;
    size_t span;      /* nodes of this value, itself included: node + span is the next one */
    size_t count;     /* values of an array, members of an object */
    const char *text; /* of a string, without its quotes */
    size_t length;
    uint64_t number; /* of a number; 0 or 1 of a bool */
};

struct json_error {
    const char *what; /* NULL: none */
    size_t position;  /* byte of the text */
};

/* Nodes that a text of `size` bytes has at most. */
size_t json_nodes_max(size_t size);

/* Read `text` into nodes[0] and what follows it. */
struct json_error json_read(const char *text, size_t size, struct json_node *nodes, size_t capacity);

/* The named member of an object, or NULL. */
const struct json_node *json_member(const struct json_node *object, const char *name);
/* Value `index` of an array, or NULL. */
const struct json_node *json_at(const struct json_node *array, size_t index);
bool json_is(const struct json_node *string, const char *text);

/* Bytes of a string of hexadecimal digits; false if it is none or has more than `capacity` bytes. */
bool json_hex(const struct json_node *string, uint8_t *bytes, size_t capacity, size_t *size);

#endif
