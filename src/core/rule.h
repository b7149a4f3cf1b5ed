/* rule.h - what the walk asks of a rule beside the questions of rqt.h. Private to the core. */
#ifndef RQT_RULE_H
#define RQT_RULE_H

#include "internal.h"

/* Of the vertices in the closed cell of a centre, but for its corners: their thresholds lie in least .. most; may
 * one of them be forced, or have a threshold of a place's eps? */
typedef struct rule_range {
    int32_t least, most;
    bool forced, places;
} rule_range;
rule_range rule_range_below(const rqt_rule *rule, rqt_vertex centre);
/* The threshold by rank, RQT_RANKS of them, where there is neither a place nor a square nor a forced vertex. */
const int32_t *rule_thresholds(const rqt_rule *rule);
const rqt_lattice *rule_lattice(const rqt_rule *rule);
const rqt_field *rule_field(const rqt_rule *rule); /* NULL: none */
/* The threshold of a vertex of this rank by the rule's own eps and a field's code. */
int32_t rule_field_threshold(const rqt_rule *rule, rqt_code code, int rank);
/* Is that, for every rank, the code or *most, whichever is less? */
bool rule_takes_codes(const rqt_rule *rule, int32_t *most);

/* Of a rule without places and forced vertices: chosen[i] = 1 for every vertex of the block that is
 * selected, row by row, else 0; 0 for its corners. What is selected, by error or a flag of the mask, must be
 * closed. Returns the flags that all of the chosen have. */
uint8_t rule_choose(const rqt_rule *rule, const rqt_block_place *place, const rqt_block *block, uint8_t mask,
                    uint8_t *chosen);

#endif
