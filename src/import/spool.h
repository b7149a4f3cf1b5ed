/* spool.h - the resume file: what a long import has read, so that it need not be read again. See spool.c. */
#ifndef RQT_IMPORT_SPOOL_H
#define RQT_IMPORT_SPOOL_H

#include "parts.h"

/* ------------------------------------------------------------------------------------------ spool_codec.c --
 * Strips of at most `rows` rows -> bytes -> strips. Belongs to one thread. */
typedef struct spool_codec spool_codec;
typedef struct spool_bytes {
    const uint8_t *packed; /* valid until the next call; NULL: out of memory */
    size_t size;           /* of packed */
    size_t plain;          /* before compression */
} spool_bytes;

bool spool_codec_create(const import_job *job, import_kind kind, int32_t width, int32_t rows, spool_codec **codec);
void spool_codec_free(spool_codec *codec);
size_t spool_codec_bytes(import_kind kind, int32_t width, int32_t rows); /* of memory */
/* `more`: bytes that go along as they are. */
spool_bytes spool_encode(spool_codec *codec, const import_strip *strip, const void *more, size_t more_size);
/* Room for the packed bytes of a strip that is to be decoded; NULL: out of memory. */
uint8_t *spool_packed_room(spool_codec *codec, size_t size);
/* The largest `plain` of a strip of so many rows. */
size_t spool_plain_most(const spool_codec *codec, int32_t rows, size_t more_size);
/* The packed bytes in that room -> strip->values, strip->valid and more. False: they are no such strip. */
bool spool_decode(spool_codec *codec, size_t packed, size_t plain, import_strip *strip, void *more,
                  size_t more_size);

#endif
