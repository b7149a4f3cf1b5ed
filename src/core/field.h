/* field.h - what a rule asks of a field beside the questions of rqt.h. Private to the core. */
#ifndef RQT_FIELD_H
#define RQT_FIELD_H

#include "internal.h"

bool field_is_over(const rqt_field *field, const rqt_lattice *lattice);
/* As rqt_field_least, as a code: RQT_CODE_INFINITY where nothing is asked for. */
rqt_code field_least(const rqt_field *field, int32_t x0, int32_t y0, int32_t x1, int32_t y1);
/* The code of the square that holds the box, or RQT_CODE_INFINITY: none does. */
rqt_code field_holding(const rqt_field *field, int32_t x0, int32_t y0, int32_t x1, int32_t y1);

/* A square of the tree, or a place in a larger one that is not cut: for who goes down from squares to their halves
 * and looks at what is around them. */
typedef uint32_t field_node;
/* Of the square of that side, a power of two, at (x,y), a multiple of it, wherever that is. */
field_node field_node_at(const rqt_field *field, int32_t x, int32_t y, int32_t side);
/* The least code of the squares that have a point in common with its interior. */
rqt_code field_node_least(const rqt_field *field, field_node at);
/* Is none of nine squares cut? Then, the code of each. */
bool field_are_leaves(const rqt_field *field, const field_node nine[9], rqt_code codes[9]);
/* Nine squares side by side, row by row, are six by six of half their side: the least code of each, column by
 * column; and the quarter c (0 NW, 1 NE, 2 SW, 3 SE) of the one in the middle with the eight around it. */
void field_halve(const rqt_field *field, const field_node nine[9], rqt_code least[6][6]);
void field_around_quarter(const rqt_field *field, const field_node nine[9], int c, field_node around[9]);

#endif
