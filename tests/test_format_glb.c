/* test_format_glb.c - glTF in memory: what is written is just as long as was asked for, sound at every count, and
 * what cannot be written is refused. (tests/test_sql_glb.py reads the files; glTF's own validator does in
 * tests/web.) Links: format.c, glb.c, text.c, geometry.c, the core's code.c (or librqt.a), cmocka. */
#include "test_format_support.h"

#include <cjson/cJSON.h>

static const double place[3] = {7, 47, 0};

/* A strip of triangles as a model, of which the tests change one thing or another. */
typedef struct sample_model {
    sample_patch s;
    format_source source;
    format_model model;
    format_mesh mesh;
    float *normals;
} sample_model;

static void model_begin(sample_model *m, int count, bool quantized, bool normals) {
    patch_begin(&m->s, count, 2056);
    m->source = (format_source){&m->s.patch, &m->s.frame};
    m->model = (format_model){.frame = "crs",
                              .metre = 0.5,
                              .step = {1.0 / 3600, 1.0 / 3600, 0.1 * 381 / 1250},
                              .quantum = 0.1 * 381 / 1250,
                              .quantized = quantized};
    m->mesh = format_mesh_of(&m->source);
    m->mesh.model = &m->model;
    m->normals = calloc(3 * m->s.patch.vertex_count + 1, sizeof *m->normals);
    assert_non_null(m->normals);
    for (size_t i = 0; i < m->s.patch.vertex_count; i++) m->normals[3 * i + i % 3] = i % 2 ? -1 : 1;
    if (normals) m->mesh.normals = m->normals;
}

static void model_end(sample_model *m) {
    free(m->normals);
    patch_end(&m->s);
}

static uint8_t *write_model(sample_model *m, size_t *size) {
    uint8_t *bytes = NULL;
    const int before = m->s.heap.asked;
    assert_int_equal(format_write(&m->mesh, FORMAT_GLB, &m->s.allocator, &bytes, size), RQT_OK);
    assert_int_equal(m->s.heap.asked, before + 1);
    assert_int_equal(m->s.heap.last, *size);
    return bytes;
}

/* The JSON, and how large the buffer is that follows; both chunks are looked at. */
static cJSON *read_model(const uint8_t *bytes, size_t size, size_t *buffer) {
    reader r = {bytes, bytes + size};
    assert_memory_equal(take(&r, 4), "glTF", 4);
    assert_int_equal(take_u32(&r), 2);
    assert_int_equal(take_u32(&r), size);
    const size_t text = take_u32(&r);
    assert_int_equal(text % 4, 0);
    assert_memory_equal(take(&r, 4), "JSON", 4);
    cJSON *json = cJSON_ParseWithLength((const char *)take(&r, text), text);
    assert_non_null(json);
    *buffer = 0;
    if (r.p == r.end) return json;
    *buffer = take_u32(&r);
    assert_int_equal(*buffer % 4, 0);
    assert_memory_equal(take(&r, 4), "BIN", 4);
    (void)take(&r, *buffer);
    assert_ptr_equal(r.p, r.end);
    return json;
}

static void models_of_every_count_are_whole(void **state) {
    (void)state;
    static const int counts[] = {0, 1, 2, 3, 10, 997, 65533, 65534};
    for (size_t c = 0; c < sizeof counts / sizeof *counts; c++)
        for (int kind = 0; kind < 4; kind++) {
            sample_model m;
            model_begin(&m, counts[c], kind & 1, kind & 2);
            size_t size, buffer;
            uint8_t *bytes = write_model(&m, &size);
            cJSON *json = read_model(bytes, size, &buffer);
            const size_t n = m.s.patch.vertex_count, t = m.s.patch.triangle_count;
            const cJSON *views = cJSON_GetObjectItem(json, "bufferViews");
            assert_int_equal(cJSON_GetArraySize(views), !t ? 0 : kind & 2 ? 3 : 2);
            size_t wanted = n * (kind & 1 ? 8 : 12) + 3 * t * (n <= 65535 ? 2 : 4);
            /* 13 m of height in a step of 2^-9 .. the steps differ by far more than 256: normals are floats */
            if (kind & 2) wanted += 12 * n;
            assert_int_equal(buffer, (wanted + 3) / 4 * 4);
            cJSON_Delete(json);
            release(&m.s, bytes);
            model_end(&m);
        }
}

/* Steps of one size: normals have 16 bits, and are those given. */
static void normals_have_16_bits_where_steps_are_alike(void **state) {
    (void)state;
    static const double up[] = {1, 255, 257};
    for (size_t i = 0; i < sizeof up / sizeof *up; i++) {
        sample_model m;
        model_begin(&m, 10, true, true);
        m.s.frame.placement = (rqt_placement){0, 0, up[i], -up[i]};
        m.s.frame.unit = (rqt_unit){0, 1, 1, 1, 1, 0};
        m.model.metre = 1;
        m.model.step[0] = m.model.step[1] = up[i];
        m.model.step[2] = 1;
        for (size_t v = 0; v < m.s.patch.vertex_count; v++) m.s.patch.vertices[v].q = (int32_t)v * 3 - 7;
        size_t size, buffer;
        uint8_t *bytes = write_model(&m, &size);
        cJSON *json = read_model(bytes, size, &buffer);
        const size_t n = m.s.patch.vertex_count, each = up[i] <= 256 ? 8 : 12;
        assert_int_equal(buffer, n * (8 + each) + 60);
        const uint8_t *at = bytes + size - buffer + 8 * n;
        for (size_t v = 0; v < n && each == 8; v++)
            for (size_t axis = 0; axis < 3; axis++) {
                static const size_t of[] = {0, 2, 1}; /* Y is z; Z is -y */
                const double wanted = 32767 * (double)m.normals[3 * v + of[axis]] * (axis == 2 ? -1 : 1);
                assert_int_equal((int16_t)(at[8 * v + 2 * axis] | at[8 * v + 2 * axis + 1] << 8), (int)wanted);
            }
        cJSON_Delete(json);
        release(&m.s, bytes);
        model_end(&m);
    }
}

static void text_of_the_caller_stays_text(void **state) {
    (void)state;
    static const char title[] = "a \"b\" \\ c\n\x01 d\xC3\xA9";
    sample_model m;
    model_begin(&m, 1, false, false);
    m.mesh.title = title;
    m.mesh.eps = INFINITY;
    m.model.frame = "enu";
    m.model.place = place;
    m.model.tau = 2;
    size_t size, buffer;
    uint8_t *bytes = write_model(&m, &size);
    cJSON *json = read_model(bytes, size, &buffer);
    const cJSON *asset = cJSON_GetObjectItem(json, "asset");
    const cJSON *own = cJSON_GetObjectItem(cJSON_GetObjectItem(asset, "extras"), "rqt");
    assert_string_equal(cJSON_GetStringValue(cJSON_GetObjectItem(own, "terrain")), title);
    assert_true(cJSON_IsNull(cJSON_GetObjectItem(own, "eps")));
    assert_true(cJSON_IsFalse(cJSON_GetObjectItem(own, "guaranteed")));
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(own, "place")), 3);
    cJSON_Delete(json);
    release(&m.s, bytes);
    model_end(&m);
}

static void refuse(sample_model *m, rqt_status status) {
    uint8_t *bytes = (uint8_t *)m;
    size_t size = 1;
    assert_int_equal(format_write(&m->mesh, FORMAT_GLB, &m->s.allocator, &bytes, &size), status);
    assert_null(bytes);
    assert_int_equal(size, 0);
    assert_int_equal(m->s.heap.held, 0);
}

static void what_is_no_model_is_refused(void **state) {
    (void)state;
    for (int fault = 0; fault < 10; fault++)
        for (int quantized = 0; quantized < 2; quantized++) {
            sample_model m;
            model_begin(&m, 3, quantized, true);
            for (size_t i = 0; i < m.s.patch.vertex_count; i++) m.s.patch.vertices[i].row += 2;
            if (fault == 0) m.s.patch.triangles[8] = (uint32_t)m.s.patch.vertex_count;
            if (fault == 1) m.s.patch.triangles[4] = UINT32_MAX;
            if (fault == 2) m.s.frame.placement.x0 = NAN;
            if (fault == 3) m.s.frame.placement.dy = 1e308;
            if (fault == 4) m.s.frame.placement.dx = 1e37; /* doubles, but no floats */
            if (fault == 4) m.s.patch.vertices[1].col = 2000;
            if (fault == 5) m.s.frame.unit.scale = 1e300, m.model.step[2] = 0;
            if (fault == 6) m.mesh.vertex_count = 2147483647u / 8 + 1;
            if (fault == 7) m.mesh.vertex_count = SIZE_MAX;
            if (fault == 8) m.mesh.triangle_count = 2147483647u / 8 + 1;
            if (fault == 9) m.mesh.model = NULL;
            refuse(&m, RQT_INVALID);
            assert_int_equal(m.s.heap.asked, 0);
            model_end(&m);
        }
    for (int n = 0; n < 2; n++) {
        sample_model m;
        model_begin(&m, n, n, n);
        m.s.heap.refuses = true;
        refuse(&m, RQT_NO_MEMORY);
        model_end(&m);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(models_of_every_count_are_whole, begin),
        cmocka_unit_test_setup(normals_have_16_bits_where_steps_are_alike, begin),
        cmocka_unit_test_setup(text_of_the_caller_stays_text, begin),
        cmocka_unit_test_setup(what_is_no_model_is_refused, begin),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
