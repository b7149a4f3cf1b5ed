/* web_files.h - the files that are compiled in: those of web/ and openapi.json, by name, gzipped (embed.sh writes
 * the table). */
#ifndef RQT_SERVE_WEB_FILES_H
#define RQT_SERVE_WEB_FILES_H

typedef struct web_file {
    const char *name;                 /* without a folder */
    const unsigned char *bytes, *end; /* gzip */
} web_file;

extern const web_file web_files[];
extern const int web_file_count;

#endif
