/* page.c - the pages that people look at: the files of web/, which are in the program (embed.sh). No file is read.
 *
 * They are gzipped once, when the program is made: browsers, which all take gzip, get these bytes. For who does not
 * they are unpacked.
 */
#include "internal.h"

#include "web_files.h"

#include <stdio.h>
#include <string.h>
#include <zlib.h>

static const char *type_of(const char *name) {
    static const struct {
        const char *ending, *type;
    } types[] = {{".html", "text/html; charset=utf-8"},
                 {".js", "text/javascript; charset=utf-8"},
                 {".mjs", "text/javascript; charset=utf-8"},
                 {".css", "text/css; charset=utf-8"},
                 {".json", "application/json"},
                 {".map", "application/json"},
                 {".svg", "image/svg+xml"},
                 {".png", "image/png"},
                 {".ico", "image/x-icon"},
                 {".wasm", "application/wasm"},
                 {".txt", "text/plain; charset=utf-8"},
                 {".md", "text/plain; charset=utf-8"}};
    const char *ending = strrchr(name, '.');
    for (size_t i = 0; ending && i < sizeof types / sizeof *types; i++)
        if (strcmp(types[i].ending, ending) == 0) return types[i].type;
    return "application/octet-stream";
}

static const web_file *find_file(const char *name) {
    for (int i = 0; i < web_file_count; i++)
        if (strcmp(web_files[i].name, name) == 0) return &web_files[i];
    return NULL;
}

bool page_is(const request *r) {
    return r->segment_count == 1 && find_file(r->segments[0]) != NULL;
}

enum { GZIP_WINDOW = 15 + 16, GZIP_TRAILER = 8, CHUNK = 32768 };

/* What gzip has at its end of what is packed: checksum and size. The file is known by them. */
static uint64_t trailer_of(const web_file *file) {
    uint64_t trailer = 0;
    for (const unsigned char *p = file->end - GZIP_TRAILER; p < file->end; p++) trailer = trailer << 8 | *p;
    return trailer;
}

static void unpack(const web_file *file, buffer *out) {
    unsigned char chunk[CHUNK];
    z_stream z = {.next_in = (Bytef *)file->bytes, .avail_in = (uInt)(file->end - file->bytes)};
    out->no_memory = inflateInit2(&z, GZIP_WINDOW) != Z_OK;
    for (int status = Z_OK; status == Z_OK && !out->no_memory && !out->is_over;) {
        z.next_out = chunk;
        z.avail_out = sizeof chunk;
        status = inflate(&z, Z_NO_FLUSH);
        if (status != Z_OK && status != Z_STREAM_END) out->no_memory = true;
        buffer_add(out, chunk, sizeof chunk - z.avail_out);
    }
    inflateEnd(&z);
}

void page_answer(request *r, const char *name) {
    const web_file *file = find_file(name);
    answer *a = &r->answer;
    const char *type = type_of(name);
    const bool is_image = strncmp(type, "image/", 6) == 0 && strcmp(type, "image/svg+xml") != 0;
    a->is_gzipped = true;
    /* What is compiled in changes with the program alone. */
    if (!endpoint_represent(r, trailer_of(file) | 1, type, is_image, false)) return;
    a->is_page = strncmp(type, "text/html", 9) == 0;
    if (a->coding == CODING_GZIP)
        buffer_add(&a->body, file->bytes, (size_t)(file->end - file->bytes));
    else
        unpack(file, &a->body);
}

void answer_cesium(worker *w, request *r) {
    (void)w;
    page_answer(r, "cesium.html");
}

void answer_openapi(worker *w, request *r) {
    (void)w;
    page_answer(r, "openapi.json");
    if (r->answer.status == MHD_HTTP_OK) r->answer.type = "application/vnd.oai.openapi+json;version=3.0";
}
