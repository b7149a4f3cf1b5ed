/* text.h - numbers, lengths and names for people: what the command says and pictures show. */
#ifndef RQT_TEXT_H
#define RQT_TEXT_H

#include "store.h"

/* Texts of a ring of buffers, the thread's own: good for the arguments of one printf. */
const char *text_count(int64_t n);                 /* 1 234 567 */
const char *text_real(double value);               /* 6 significant digits, no trailing zeros */
const char *text_metres(double value);             /* an error: 4 significant digits, plain */
const char *text_place(double value, bool lonlat); /* a coordinate, to 0.1 m or better, no trailing zeros */
const char *text_length(double metres);            /* 850 m, 12.3 km */
const char *text_crs_name(const char *wkt);        /* the name in a WKT, "none" when there is none */
/* The same for people: "EPSG:26710" where the WKT has a code and no name worth showing. */
const char *text_crs_label(const store_terrain *terrain);

/* Metres of ground for one column and one row in the middle of a window; for lon/lat at the middle latitude. */
void text_ground(const store_terrain *terrain, int32_t row0, int32_t rows, double *per_column, double *per_row);

#endif
