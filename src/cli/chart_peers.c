/* chart_peers.c - meshes of other programs, as points of the same charts.
 *
 * The file is what tests/bench/verify_peers writes: a line of names, then a line for each mesh. Its errors are
 * found by the verifier that rqt_verify() uses, over the same samples.
 */
#include "chart.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char HEAD[] = "series,asked,max_error,rms_error,samples,vertices,triangles,ms";
enum { COLUMNS = 8 };

/* Cuts the line at its commas; false unless there are exactly COLUMNS texts. */
static bool split(char *line, char *cells[COLUMNS]) {
    line[strcspn(line, "\r\n")] = 0;
    for (int i = 0; i < COLUMNS; i++) {
        cells[i] = line;
        char *comma = strchr(line, ',');
        if (!comma) return i == COLUMNS - 1;
        *comma = 0;
        line = comma + 1;
    }
    return false;
}

static bool read_row(char *line, chart_point *p) {
    char *cells[COLUMNS];
    int64_t samples, vertices, triangles;
    *p = (chart_point){.is_peer = true, .bytes = -1, .blocks = -1, .fresh_bytes = -1, .fresh_ms = -1, .runs = 1};
    if (!split(line, cells) || !*cells[0] || strlen(cells[0]) >= sizeof p->series || strpbrk(cells[0], "'\"\\"))
        return false;
    snprintf(p->series, sizeof p->series, "%s", cells[0]);
    if (!cli_number(cells[1], &p->eps) || !cli_number(cells[2], &p->max_error) ||
        !cli_number(cells[3], &p->rms_error) || !cli_integer(cells[4], 0, INT64_MAX, &samples) ||
        !cli_integer(cells[5], 0, INT64_MAX, &vertices) || !cli_integer(cells[6], 0, INT64_MAX, &triangles) ||
        !cli_number(cells[7], &p->ms))
        return false;
    p->samples = samples;
    p->vertices = vertices;
    p->triangles = triangles;
    return p->eps >= 0 && p->max_error >= 0 && p->rms_error >= 0 && p->ms >= 0;
}

bool chart_read_peers(const char *path, int64_t samples, chart_points *points) {
    FILE *file = fopen(path, "re");
    if (!file) {
        cli_fail("%s: %s", path, strerror(errno));
        return false;
    }
    char line[512];
    bool ok =
        fgets(line, sizeof line, file) && !strncmp(line, HEAD, strlen(HEAD)) && strchr("\r\n", line[strlen(HEAD)]);
    if (!ok) cli_fail("%s is no file of peers: its first line is not %s", path, HEAD);
    int64_t other = 0;
    for (int number = 2; ok && fgets(line, sizeof line, file); number++) {
        chart_point point;
        ok = read_row(line, &point);
        if (!ok)
            cli_fail("%s: line %d is no row of a peer", path, number);
        else if (point.samples != samples)
            other = point.samples;
        else
            ok = chart_points_add(points, &point);
    }
    if (ok && ferror(file)) ok = cli_fail("%s: it cannot be read", path) == CLI_OK;
    fclose(file);
    if (ok && other)
        cli_say("%s has meshes of %s samples, and here are %s: they are left out", path, text_count(other),
                text_count(samples));
    return ok;
}
