/* rule.h - what the walk asks of a rule beside the questions of rqt.h. Private to the core. */
#ifndef RQT_RULE_H
#define RQT_RULE_H

#include "internal.h"

/* Of the vertices in the closed cell of a centre, but for its corners: their thresholds lie in least .. most; may
 * one of them be forced? */
typedef struct rule_range {
    int32_t least, most;
    bool forced;
} rule_range;
rule_range rule_range_below(const rqt_rule *rule, rqt_vertex centre);
const rqt_lattice *rule_lattice(const rqt_rule *rule);

#endif
