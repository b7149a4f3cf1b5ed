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
const rqt_lattice *rule_lattice(const rqt_rule *rule);
const rqt_field *rule_field(const rqt_rule *rule); /* NULL: none */
bool rule_lowers(const rqt_rule *rule);
/* The threshold of a vertex of this rank by the rule's own eps and a field's code. */
int32_t rule_field_threshold(const rqt_rule *rule, rqt_code code, int rank);

/* Of a rule with a field, for every vertex of a block, row by row, but its corners: the least error that selects it
 * on account of the rule's own eps and the field; 0 where any does. room: rule_limits_room(k) values. */
size_t rule_limits_room(int k);
void rule_limits(const rqt_rule *rule, const rqt_block_place *place, int k, uint16_t *limits, uint16_t *room);

#endif
