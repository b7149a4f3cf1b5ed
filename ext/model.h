/* model.h - a mesh of the answer as what a glb wants: metres, about an origin. */
#ifndef RQT_EXT_MODEL_H
#define RQT_EXT_MODEL_H

#include "view.h"

#include "format.h"

typedef struct model {
    format_mesh mesh; /* with what it points to below */
    format_model how;
    double place[3];
    double *xyz;    /* NULL, or of every vertex */
    float *normals; /* NULL, or of every vertex */
} model;

/* mesh: in the coordinates of the request's answer; it outlives the model. Always pair with model_free. */
int model_create(const request *r, const format_mesh *mesh, bool quantized, model *m, char **error);
void model_free(model *m);

#endif
