/* view_core.h - the guaranteed test with a piece that is known in two ways. view.c */
#ifndef RQT_VIEW_CORE_H
#define RQT_VIEW_CORE_H

#include "internal.h"
#include "rqt_view.h"

/* rqt_view_tolerance, where two prisms hold the piece: `place`, of which distances from the eye and the angles of
 * rays to verticals are taken, and `picture`, of which places in the picture are; the share is about both. */
void view_tolerance(const rqt_camera *camera, const rqt_prism *place, const rqt_prism *picture,
                    rqt_view_bound *bound);

#endif
