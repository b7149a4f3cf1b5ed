/* page.c - the page that people look at: the files of web/, which are in the program (embed.sh). No file is read.
 */
#include "internal.h"

#include "web_files.h"

#include <stdio.h>
#include <string.h>

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

void page_answer(request *r, const char *name) {
    const web_file *file = find_file(name);
    answer *a = &r->answer;
    const size_t size = (size_t)(file->end - file->bytes);
    /* What is compiled in changes with the program alone. */
    uint64_t hash = 0xCBF29CE484222325u;
    for (const unsigned char *p = file->bytes; p < file->end; p++) hash = (hash ^ *p) * 0x100000001B3u;
    const char *type = type_of(name);
    const bool is_image = strncmp(type, "image/", 6) == 0 && strcmp(type, "image/svg+xml") != 0;
    if (!endpoint_represent(r, hash | 1, type, is_image, false)) return;
    a->is_page = strncmp(type, "text/html", 9) == 0;
    buffer_add(&a->body, file->bytes, size);
}

void answer_openapi(worker *w, request *r) {
    (void)w;
    page_answer(r, "openapi.json");
    if (r->answer.status == MHD_HTTP_OK) r->answer.type = "application/vnd.oai.openapi+json;version=3.0";
}
