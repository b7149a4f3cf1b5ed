/* checksum.c - the 64-bit checksum of FORMAT.md, for everything that rqt stores.
 *
 * It guards against bad storage and bad programs, not against an attacker: one multiplication and one rotation for
 * each 8 bytes, every step a bijection, so that a change within one aligned word can never go unseen. The bytes are
 * read as little-endian words wherever this runs. */
#include "internal.h"

static inline uint64_t rotate_left(uint64_t v, int by) {
    return v << by | v >> (64 - by);
}

static inline uint64_t mix(uint64_t h, uint64_t w) {
    return rotate_left((h ^ w) * 0xC2B2AE3D27D4EB4FU, 29);
}

static uint64_t mix_words(uint64_t h, const uint8_t *bytes, size_t words) {
    for (size_t i = 0; i < words; i++) h = mix(h, get64(bytes + 8 * i));
    return h;
}

uint64_t checksum64(const uint8_t *bytes, size_t size, size_t field) {
    uint64_t h = 0x9E3779B97F4A7C15U ^ (uint64_t)size * 0xFF51AFD7ED558CCDU;
    size_t words = size / 8, skip = field / 8;
    if (skip < words) {
        h = mix(mix_words(h, bytes, skip), 0);
        h = mix_words(h, bytes + 8 * (skip + 1), words - skip - 1);
    } else {
        h = mix_words(h, bytes, words);
    }
    if (size % 8) {
        uint8_t last[8] = {0};
        memcpy(last, bytes + 8 * words, size % 8);
        h = mix(h, get64(last));
    }
    h = (h ^ h >> 32) * 0xFF51AFD7ED558CCDU;
    return h ^ h >> 29;
}
