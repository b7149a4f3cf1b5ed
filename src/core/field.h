/* field.h - what a rule asks of a field beside the questions of rqt.h. Private to the core. */
#ifndef RQT_FIELD_H
#define RQT_FIELD_H

#include "internal.h"

bool field_is_over(const rqt_field *field, const rqt_lattice *lattice);
/* As rqt_field_least, as a code: RQT_CODE_INFINITY where nothing is asked for. */
rqt_code field_least(const rqt_field *field, int32_t x0, int32_t y0, int32_t x1, int32_t y1);
/* The code of the square that holds the box, or RQT_CODE_INFINITY: none does. */
rqt_code field_holding(const rqt_field *field, int32_t x0, int32_t y0, int32_t x1, int32_t y1);

/* n * n cells of side 2^scale, side by side from (x,y) on, which are multiples of it; not larger than the root. */
typedef struct field_cells {
    int32_t x, y;
    int scale, n;
} field_cells;
/* For each cell value(context, c), c the least code of the squares that have a point in common with its interior.
 * value is asked once for the cells that a square holds, not for each. */
void field_paint(const rqt_field *field, const field_cells *cells,
                 uint16_t (*value)(const void *context, rqt_code code), const void *context, uint16_t *painted);

#endif
