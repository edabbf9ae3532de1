/* Benchmark of the processor's speed: loops, table look-ups, byte and word traffic, calls, multiplications. */
#include "image.h"

#define REPEATS 400u
#define WORDS 512u

static uint32_t table[256], words[WORDS];
static uint8_t bytes[2048];

/* Fill the table with the CRC-32 (IEEE 802.3) of each byte. */
static void make_table(void)
{
    for (uint32_t i = 0; i < 256; i++) {
        uint32_t value = i;
        for (unsigned bit = 0; bit < 8; bit++) {
            value = value & 1u ? value >> 1 ^ 0xEDB88320u : value >> 1;
        }
        table[i] = value;
    }
}

/* Return the CRC-32 (IEEE 802.3) of a buffer by table look-up: loads of bytes and words at computed addresses. */
static uint32_t crc32(const uint8_t *data, size_t size)
{
    uint32_t crc = ~0u;
    while (size--) {
        crc = crc >> 8 ^ table[(crc ^ *data++) & 0xFFu];
    }
    return ~crc;
}

/* Fill the array with numbers of a linear congruential generator. */
static void fill_words(uint32_t seed)
{
    for (size_t i = 0; i < WORDS; i++) {
        seed = seed * 1664525u + 1013904223u;
        words[i] = seed;
    }
}

/* Restore the heap order below `root`: the word moves down until both children are smaller. */
static void sift_down(size_t root, size_t size)
{
    for (;;) {
        size_t child = 2 * root + 1;
        if (child >= size) {
            return;
        }
        child += child + 1 < size && words[child] < words[child + 1];
        if (words[root] >= words[child]) {
            return;
        }
        const uint32_t swapped = words[root];
        words[root] = words[child];
        words[child] = swapped;
        root = child;
    }
}

/* Sort the words in ascending order: build a heap, then move its largest word to the end repeatedly. */
static void heap_sort(void)
{
    for (size_t i = WORDS / 2; i-- > 0;) {
        sift_down(i, WORDS);
    }
    for (size_t size = WORDS; size-- > 1;) {
        const uint32_t largest = words[0];
        words[0] = words[size];
        words[size] = largest;
        sift_down(0, size);
    }
}

/* FIR filter with 8 taps over the upper halves of the words: multiplications and byte stores. Returns the sum of the
 * outputs. */
static uint32_t filter_words(void)
{
    uint32_t sum = 0;
    for (size_t i = 8; i < WORDS; i++) {
        uint32_t value = 0;
        for (size_t k = 0; k < 8; k++) {
            value += (words[i - k] >> 16) * (k + 1);
        }
        bytes[i] = (uint8_t)(value >> 12);
        sum += value;
    }
    return sum;
}

/* Run the benchmark and print a checksum, which verifies the results and prevents the compiler from removing the work.
 */
int main(void)
{
    uint32_t check = 0;
    make_table();
    for (uint32_t repeat = 0; repeat < REPEATS; repeat++) {
        fill_words(repeat);
        check += filter_words();
        heap_sort();
        check ^= words[repeat % WORDS];
        check += crc32(bytes, sizeof bytes);
    }
    put_word("check", check);
    return 0;
}
