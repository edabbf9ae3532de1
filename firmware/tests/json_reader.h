/* A strict parser for the JSON of the vectors: objects, arrays, strings without escapes, unsigned integers, true and
 * false. Anything else is an error. It allocates no memory: nodes and text are the caller's. */
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

/* Nodes are in the order of the text: a node is followed by its children; those of an object are alternately names
 * and values. */
struct json_node {
    enum json_kind kind;
    size_t span;      /* nodes of this value, including this one: node + span is the next value */
    size_t count;     /* values of an array, members of an object */
    const char *text; /* of a string, without its quotes */
    size_t length;
    uint64_t number; /* of a number; 0 or 1 of a bool */
};

struct json_error {
    const char *message; /* NULL: no error */
    size_t position;     /* byte of the text */
};

/* Return the upper limit of the number of nodes in a text of `size` bytes. */
size_t json_nodes_max(size_t size);

/* Parse `text` into nodes[0] and the nodes after it. */
struct json_error json_read(const char *text, size_t size, struct json_node *nodes, size_t capacity);

/* Return the named member of an object, or NULL. */
const struct json_node *json_member(const struct json_node *object, const char *name);
/* Return the value `index` of an array, or NULL. */
const struct json_node *json_at(const struct json_node *array, size_t index);
bool json_is(const struct json_node *string, const char *text);

/* Decode a string of hexadecimal digits; false if it is invalid or has more than `capacity` bytes. */
bool json_hex(const struct json_node *string, uint8_t *bytes, size_t capacity, size_t *size);

#endif
