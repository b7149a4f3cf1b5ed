/* test_core_view.c - cameras, and what the guaranteed test promises of them, seen by plain projection.
 *
 * Whatever is drawn of a point S of the piece or of a point M within eps of it has to be at most tau apart in the
 * picture. Here cameras and pieces are drawn by lot, also the worst that came to mind, S and M are taken from all
 * over and from where it hurts, and projected in long double, by code of this file. That the bound is not too
 * careful is held against a search: the largest eps with which no S and M of that kind are too far apart. */
#include "test_core_support.h"

#include "rqt_view.h"

#include <math.h>

typedef struct point {
    long double c[3];
} point;

static point point_of(const double v[3]) {
    return (point){{v[0], v[1], v[2]}};
}
static long double inner(point a, point b) {
    return a.c[0] * b.c[0] + a.c[1] * b.c[1] + a.c[2] * b.c[2];
}
/* a + t b */
static point plus(point a, long double t, point b) {
    return (point){{a.c[0] + t * b.c[0], a.c[1] + t * b.c[1], a.c[2] + t * b.c[2]}};
}
static long double size_of(point a) {
    return sqrtl(inner(a, a));
}
static point outer(point a, point b) {
    return (point){
        {a.c[1] * b.c[2] - a.c[2] * b.c[1], a.c[2] * b.c[0] - a.c[0] * b.c[2], a.c[0] * b.c[1] - a.c[1] * b.c[0]}};
}
/* Of length 1; some direction for none. */
static point unit_of(point a) {
    const long double length = size_of(a);
    return length > 0 ? (point){{a.c[0] / length, a.c[1] / length, a.c[2] / length}} : (point){{1, 0, 0}};
}
static point random_direction(void) {
    for (;;) {
        const point p = {{2 * random_unit() - 1, 2 * random_unit() - 1, 2 * random_unit() - 1}};
        const long double length = size_of(p);
        if (length > 0.01L && length <= 1) return unit_of(p);
    }
}
/* Between low and high, each power of ten as often. */
static double random_size(double low, double high) {
    return low * pow(high / low, random_unit());
}

static const point NOWHERE = {{0, 0, 0}};

/* --------------------------------------------------------------------------------------- projection --
 * Points are counted from the eye: long doubles at 10^7 m would round more than the bound may lose. */
typedef struct seen {
    long double x, y, depth; /* x and y from the middle of the picture, y upward; only where depth > 0 */
    bool drawn;
} seen;

static seen look_at(const rqt_camera *c, point v) {
    seen s = {.depth = inner(v, point_of(c->forward))};
    if (!(s.depth > 0)) return s;
    s.x = c->focal * inner(v, point_of(c->right)) / s.depth;
    s.y = c->focal * inner(v, point_of(c->up)) / s.depth;
    s.drawn = s.depth >= c->near && s.depth <= c->far && fabsl(s.x) <= c->width / 2 && fabsl(s.y) <= c->height / 2;
    return s;
}

/* In units of tau; above 1: the promise is broken. 0 where nothing is drawn. */
static long double apart(const rqt_camera *c, point s, point m) {
    const seen a = look_at(c, s), b = look_at(c, m);
    if (!a.drawn && !b.drawn) return 0;
    if (!(a.depth > 0 && b.depth > 0)) return INFINITY;
    return hypotl(a.x - b.x, a.y - b.y) / c->tau;
}

/* The point of the frustum that is nearest to p, or near that: drawn. From face to face, as often as it takes. */
static point nearest_drawn(const rqt_camera *c, point p) {
    const point axis[3] = {point_of(c->right), point_of(c->up), point_of(c->forward)};
    const long double edge[2] = {c->width / 2 / c->focal, c->height / 2 / c->focal};
    point v = {{0, 0, 0}}, change[4] = {{{0, 0, 0}}};
    for (int i = 0; i < 3; i++) v.c[i] = inner(p, axis[i]);
    /* Dykstra's method. */
    for (int round = 0; round < 40; round++)
        for (int face = 0; face < 4; face++) {
            const point before = plus(v, 1, change[face]);
            point after = before;
            const int i = face % 2;
            if (face < 2) {
                const long double size = sqrtl(1 + edge[i] * edge[i]),
                                  past = (fabsl(before.c[i]) - edge[i] * before.c[2]) / size;
                if (past > 0) {
                    after.c[i] -= copysignl(past / size, before.c[i]);
                    after.c[2] += past * edge[i] / size;
                }
            } else if (face == 2 && after.c[2] < c->near) {
                after.c[2] = c->near;
            } else if (face == 3 && after.c[2] > c->far) {
                after.c[2] = c->far;
            }
            change[face] = plus(before, -1, after);
            v = after;
        }
    /* A hair inside. */
    v.c[2] = fminl(fmaxl(v.c[2], c->near), c->far);
    for (int i = 0; i < 2; i++) v.c[i] = copysignl(fminl(fabsl(v.c[i]), edge[i] * v.c[2]), v.c[i]) * (1 - 1e-17L);
    return plus(plus(plus(NOWHERE, v.c[0], axis[0]), v.c[1], axis[1]), v.c[2], axis[2]);
}

/* ------------------------------------------------------------------------------------ cameras, pieces -- */
typedef struct scene {
    rqt_camera camera;
    rqt_prism prism;
} scene;

static void set_doubles(double out[3], point p) {
    for (int i = 0; i < 3; i++) out[i] = (double)p.c[i];
}

/* A prism in long double, counted from some point. */
typedef struct piece {
    point centre, up;
    long double radius, half_height;
} piece;

static piece piece_from(const rqt_prism *p, const double from[3]) {
    return (piece){plus(point_of(p->centre), -1, point_of(from)), point_of(p->up), p->radius, p->half_height};
}

/* A point of the piece: any, or one of its rim, its faces, its middle. */
static point point_in(const piece *p) {
    const point up = p->up, aside = unit_of(outer(up, random_direction()));
    const long double high = random_between(0, 2) ? 2 * random_unit() - 1 : random_between(-1, 1),
                      wide = random_between(0, 2) ? sqrt(random_unit()) : random_between(0, 1);
    return plus(plus(p->centre, high * p->half_height, up), wide * p->radius, aside);
}

/* The point of the piece that is nearest to q. */
static point nearest_in(const piece *p, point q) {
    const point up = p->up, v = plus(q, -1, p->centre);
    const long double along = inner(v, up);
    const point rest = plus(v, -along, up);
    const long double across = size_of(rest), high = fmaxl(-p->half_height, fminl(p->half_height, along));
    return plus(plus(p->centre, high, up), across > 0 ? fminl(across, p->radius) / across : 0, rest);
}

static void aim(rqt_camera *c, point eye, point direction, point vertical, double fovy) {
    static const double east[3] = {1, 0, 0};
    double e[3], d[3], v[3];
    set_doubles(e, eye);
    set_doubles(d, direction);
    set_doubles(v, vertical);
    rqt_message message = {""};
    CHECK(rqt_camera_look(c, e, d, v, east, fovy, &message) == RQT_OK, "%s", message.text);
}

typedef enum whereabouts { AROUND, INSIDE, FAR_AWAY, ABOVE, ON_FACE, BESIDE, ANYWHERE } whereabouts;

/* A camera somewhere, that looks at the piece, past it, or elsewhere. fovy 0: any. */
static scene random_scene(whereabouts where, double fovy) {
    scene s = {.prism = {.radius = random_size(0.1, 1e5)}};
    rqt_prism *p = &s.prism;
    p->half_height = random_between(0, 4) ? p->radius * random_size(1e-3, 10) : 0;
    if (random_between(0, 9) == 0) p->radius = 0;
    const double extent = p->radius + p->half_height + 0.01;
    const point up = random_between(0, 1) ? (point){{0, 0, 1}} : random_direction(),
                origin = plus(NOWHERE, random_between(0, 1) ? 0 : 1e7L * random_unit(), random_direction());
    set_doubles(p->up, up);
    const double upright[] = {0, 1, 1, random_unit(), 1 - random_size(1e-9, 0.1)};
    p->upright = upright[random_between(0, 4)];
    set_doubles(p->centre, origin);
    const piece ground = piece_from(p, (const double[3]){0, 0, 0});

    if (where == ANYWHERE) where = random_between(0, 9) < 4 ? AROUND : random_between(INSIDE, BESIDE);
    const point centre = point_of(p->centre), side = unit_of(outer(up, random_direction()));
    const double away = random_size(0.1, 1e4) * extent;
    point eye = plus(centre, away, random_direction());
    if (where == INSIDE) eye = point_in(&ground);
    if (where == FAR_AWAY) eye = plus(centre, 1e9, random_direction());
    if (where == ABOVE) eye = plus(centre, p->half_height + away, up);
    if (where == ON_FACE)
        eye = random_between(0, 1) ? plus(plus(centre, p->half_height, up), random_unit() * p->radius, side)
                                   : plus(plus(centre, random_unit() * p->half_height, up), p->radius, side);
    if (where == BESIDE) eye = plus(nearest_in(&ground, eye), random_size(1e-4, 1) * extent, random_direction());

    rqt_camera *c = &s.camera;
    c->width = random_between(0, 9) ? random_between(100, 4000) : 1;
    c->height = random_between(0, 9) ? random_between(100, 3000) : 1;
    c->tau = random_between(0, 9) ? random_size(0.1, 20) : random_size(1e-6, 1e4);
    c->near = 0;
    c->far = INFINITY;
    if (fovy == 0) fovy = random_between(0, 3) ? 180 - random_size(10, 179.99) : random_size(0.01, 10);
    const point target = random_between(0, 1) ? point_in(&ground) : centre;
    point direction =
        where == ABOVE && random_between(0, 3) ? plus(NOWHERE, -1, up) : unit_of(plus(target, -1, eye));
    const int turn = random_between(0, 5);
    if (turn == 0) direction = random_direction();
    /* The piece about the picture's border. */
    if (turn <= 2) {
        const point over = unit_of(outer(direction, random_direction()));
        direction = plus(direction, tanl(fovy * 0.0087266L) * (0.7L + random_unit()), over);
    }
    aim(c, eye, direction, random_between(0, 1) ? up : random_direction(), fovy);
    const double distance = (double)size_of(plus(target, -1, eye)) + 1e-3;
    const int planes = random_between(0, 7);
    if (planes == 0) c->near = distance * random_size(1e-6, 2);
    if (planes == 1) c->far = distance * random_size(0.2, 2);
    if (planes == 2) c->near = distance * random_size(0.5, 1.2), c->far = c->near * random_size(1.0001, 2);
    return s;
}

/* --------------------------------------------------------------------------------------- the promise -- */

/* The direction that is nearest to one and makes an angle with up, or down, that a piece's meshes may differ in. */
static point admitted(const rqt_prism *p, point direction) {
    const point up = unit_of(point_of(p->up)), one = unit_of(direction);
    const long double cosine = inner(one, up), sine = sqrtl(fmaxl(0, 1 - (long double)p->upright * p->upright));
    if (fabsl(cosine) >= p->upright) return one;
    return plus(plus(NOWHERE, copysignl(p->upright, cosine), up), sine, unit_of(plus(one, -cosine, up)));
}

/* The worst of a point S with M within eps, in units of tau. */
static long double worst_of(const scene *place, point s, long double eps, int directions) {
    const rqt_camera *c = &place->camera;
    const rqt_prism *ground = &place->prism;
    /* Worst on the screen: in the plane of the ray and the axis (any, where they are one), there and back. */
    const point along = unit_of(s), forward = point_of(c->forward),
                across = plus(forward, -inner(forward, along), along), right = point_of(c->right),
                back = unit_of(size_of(across) > 1e-9L ? across : plus(right, -inner(right, along), along));
    long double worst = apart(c, s, s);
    for (int n = 0; n < directions; n++) {
        const long double turn = 6.283185307179586477L * n / directions;
        const point way = plus(plus(NOWHERE, cosl(turn), back), sinl(turn), along);
        worst = fmaxl(worst, apart(c, s, plus(s, eps, admitted(ground, way))));
    }
    /* The tangents from the eye to the ball around S. */
    const long double distance = size_of(s);
    if (eps < distance) {
        const long double sine = eps / distance, cosine = sqrtl(1 - sine * sine);
        for (int sign = -1; sign <= 1; sign += 2)
            worst = fmaxl(
                worst,
                apart(c, s,
                      plus(s, eps, admitted(ground, plus(plus(NOWHERE, sign * cosine, back), -sine, along)))));
    }
    /* Into what is drawn, as far as it goes. */
    const point target = nearest_drawn(c, s), way = plus(target, -1, s);
    const long double length = size_of(way);
    if (length > 0) worst = fmaxl(worst, apart(c, s, plus(s, fminl(length, eps), admitted(ground, way))));
    return worst;
}

/* Points of the piece where it hurts, and any. */
static point sample(const scene *s, int n) {
    const piece p = piece_from(&s->prism, s->camera.eye);
    if (n == 0) return nearest_in(&p, NOWHERE);
    if (n == 1) return nearest_in(&p, nearest_drawn(&s->camera, p.centre));
    if (n == 2) return nearest_in(&p, nearest_drawn(&s->camera, sample(s, 1)));
    if (n == 3) return nearest_in(&p, plus(NOWHERE, s->camera.near, point_of(s->camera.forward)));
    if (n == 4) return nearest_in(&p, plus(sample(s, 0), 1, random_direction()));
    return point_in(&p);
}

typedef struct tally {
    long double worst; /* in units of tau */
    int drawn, shown, hidden;
} tally;

static void keep_promise(const scene *s, int samples, tally *t) {
    const rqt_camera *c = &s->camera;
    rqt_view_bound b;
    rqt_view_tolerance(c, &s->prism, &b);
    CHECK(b.eps >= 0 && isfinite(b.eps), "eps %g", b.eps);
    CHECK(b.distance >= 0 && b.share >= 0 && b.share <= 1, "distance %g, share %g", b.distance, b.share);
    t->shown += b.shown;
    t->hidden += !b.shown;
    for (int n = 0; n < samples; n++) {
        const point p = sample(s, n);
        CHECK(size_of(p) >= b.distance, "sample %d is nearer than %g", n, b.distance);
        long double worst = worst_of(s, p, b.eps, 8);
        for (int m = 0; m < 4; m++) {
            const long double length = random_between(0, 1) ? 1 : random_unit();
            worst = fmaxl(worst, apart(c, p, plus(p, b.eps * length, admitted(&s->prism, random_direction()))));
        }
        CHECK(b.shown || worst == 0, "sample %d: something is drawn, and the piece is not shown (eps %g)", n,
              b.eps);
        /* Of what a long double rounds, so far away, eps may be a few. */
        const long double rounding = b.eps > 0 ? 1e-18L * size_of(p) / b.eps : 0;
        CHECK(worst <= 1 + rounding, "sample %d: %.12Lg tau, eps %g, distance %g, focal %g", n, worst, b.eps,
              b.distance, c->focal);
        t->worst = fmaxl(t->worst, worst);
        t->drawn += worst > 0;
    }
}

static void cameras_of_all_kinds(void **state) {
    (void)state;
    random_begin(__func__);
    tally t = {0};
    for (int n = 0; n < 6000; n++) {
        const scene s = random_scene(ANYWHERE, 0);
        keep_promise(&s, 10, &t);
    }
    print_message("%d shown, %d not; the worst of %d drawn points %.6Lf tau\n", t.shown, t.hidden, t.drawn,
                  t.worst);
    CHECK(t.worst > 0.999L, "the worst is %Lg tau", t.worst);
    CHECK(t.shown > 1000 && t.hidden > 1000 && t.drawn > 10000, "%d, %d, %d", t.shown, t.hidden, t.drawn);
}

static void F31_eyes_inside_on_faces_and_far_away(void **state) {
    (void)state;
    random_begin(__func__);
    static const whereabouts places[] = {INSIDE, ON_FACE, FAR_AWAY, BESIDE};
    for (int place = 0; place < 4; place++) {
        tally t = {0};
        for (int n = 0; n < 800; n++) {
            const scene s = random_scene(places[place], 0);
            rqt_view_bound b;
            rqt_view_tolerance(&s.camera, &s.prism, &b);
            if (places[place] == INSIDE) CHECK(b.distance < 1e-8, "an eye inside is %g away", b.distance);
            keep_promise(&s, 8, &t);
        }
        CHECK(t.drawn > 500, "%d are drawn", t.drawn);
    }
    /* At a sample's very place, which has no direction. */
    scene s = random_scene(INSIDE, 60);
    memcpy(s.camera.eye, s.prism.centre, sizeof s.camera.eye);
    s.camera.near = 0;
    s.prism.radius = 10;
    rqt_view_bound b;
    rqt_view_tolerance(&s.camera, &s.prism, &b);
    CHECK(b.eps == 0 && b.shown && b.distance == 0 && b.share == 0, "eps %g, share %g", b.eps, b.share);
    s.prism.radius = s.prism.half_height = 0;
    rqt_view_tolerance(&s.camera, &s.prism, &b);
    CHECK(b.eps == 0 && b.share == 1, "a point in the eye: eps %g, share %g", b.eps, b.share);
    /* Beyond all squares of doubles, and no numbers: nothing may move, everything may be seen. */
    static const double wild[] = {1e200, -1e308, NAN, INFINITY};
    for (int n = 0; n < 4; n++) {
        s = random_scene(AROUND, 60);
        s.camera.eye[n % 3] = wild[n];
        rqt_view_tolerance(&s.camera, &s.prism, &b);
        CHECK(b.eps == 0 && b.shown && b.distance == 0 && b.share == 0, "eye %g: eps %g", wild[n], b.eps);
    }
    for (int n = 0; n < 100; n++) {
        s = random_scene(AROUND, 60);
        s.camera.tau = INFINITY;
        rqt_view_tolerance(&s.camera, &s.prism, &b);
        CHECK(b.eps == 0 && b.shown && b.share == 0, "no number of pixels: eps %g", b.eps);
    }
}

static void F33_straight_down(void **state) {
    (void)state;
    random_begin(__func__);
    tally t = {0};
    for (int n = 0; n < 1500; n++) {
        const scene s = random_scene(ABOVE, 0);
        keep_promise(&s, 8, &t);
    }
    CHECK(t.drawn > 2000 && t.worst > 0.99L, "%d are drawn, the worst %Lg tau", t.drawn, t.worst);
}

static void F34_far_from_the_origin_nothing_is_lost(void **state) {
    (void)state;
    random_begin(__func__);
    for (int n = 0; n < 500; n++) {
        /* Numbers of few digits, so that moving them rounds nothing. */
        scene s = random_scene(AROUND, 0);
        for (int i = 0; i < 3; i++) {
            s.prism.centre[i] = random_between(-1000, 1000);
            s.camera.eye[i] = random_between(-4000, 4000);
        }
        s.prism.radius = random_between(0, 200);
        s.prism.half_height = random_between(0, 50);
        rqt_view_bound near, far;
        rqt_view_tolerance(&s.camera, &s.prism, &near);
        for (int i = 0; i < 3; i++) {
            s.prism.centre[i] += 1e7;
            s.camera.eye[i] += 1e7;
        }
        rqt_view_tolerance(&s.camera, &s.prism, &far);
        CHECK(memcmp(&near.eps, &far.eps, sizeof near.eps) == 0 && near.shown == far.shown, "eps %g, %g", near.eps,
              far.eps);
    }
}

/* ------------------------------------------------------------------------------------ not too careful -- */

static int by_size(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The largest eps for which none of these points is seen to break the promise: the best possible is not above. */
static double best_by_search(const scene *s, double from) {
    point points[24];
    for (int n = 0; n < 24; n++) points[n] = sample(s, n);
    long double least = from, most = INFINITY;
    for (int step = 0; step < 60 && most > least * 1.0005L; step++) {
        const long double eps = isinf(most) ? least * 2 : sqrtl(least * most);
        long double worst = 0;
        for (int n = 0; n < 24 && worst <= 1; n++) worst = worst_of(s, points[n], eps, 24);
        if (worst <= 1)
            least = eps;
        else
            most = eps;
    }
    return (double)least;
}

enum { PIECES = 41 };

/* A piece of a twentieth of its distance, inside the picture or past its border by `past` half-widths. */
static scene piece_in_view(double fovy, double past) {
    scene s = {.prism = {.centre = {0, 0, 0}, .up = {0, 0, 1}, .radius = random_size(1, 1e4)}};
    rqt_camera *c = &s.camera;
    *c = (rqt_camera){.width = 1600, .height = 900, .near = 0, .far = INFINITY, .tau = 1};
    const double distance = 20 * s.prism.radius, edge = tan(fovy * 0.00872664625997) * 16 / 9;
    s.prism.half_height = s.prism.radius / 10;
    const point eye = plus(NOWHERE, distance, random_direction()), direction = unit_of(plus(NOWHERE, -1, eye));
    aim(c, eye, direction, random_direction(), fovy);
    /* Off the axis, sideways. */
    const long double off = past > 0 ? edge * (1 + past) : edge * (1.6L * random_unit() - 0.8L);
    aim(c, eye, plus(direction, off, point_of(c->right)), point_of(c->up), fovy);
    return s;
}

static void F32_fields_of_view_from_hundredths_to_170_degrees(void **state) {
    (void)state;
    random_begin(__func__);
    static const double fovy[] = {0.01, 1, 20, 60, 90, 120, 150, 170};
    /* A piece is 1/10 of its distance in depth and width, so the best part of it is no measure: what is reached is,
     * of what any bound can give to all of it. */
    static const double wanted[] = {0.93, 0.95, 0.96, 0.94, 0.92, 0.88, 0.8, 0.6};
    for (int f = 0; f < 8; f++) {
        double share[PIECES];
        tally t = {0};
        for (int n = 0; n < PIECES; n++) {
            const scene s = piece_in_view(fovy[f], 0);
            rqt_view_bound b;
            rqt_view_tolerance(&s.camera, &s.prism, &b);
            assert_true(b.shown);
            keep_promise(&s, 12, &t);
            share[n] = b.eps / best_by_search(&s, b.eps);
        }
        for (int n = 0; n < 300; n++) {
            const scene s = random_scene(ANYWHERE, fovy[f]);
            keep_promise(&s, 8, &t);
        }
        qsort(share, PIECES, sizeof *share, by_size);
        print_message("%6.2f degrees: eps is %.3f of the best possible (median; least %.3f), worst %.6Lf tau\n",
                      fovy[f], share[PIECES / 2], share[0], t.worst);
        CHECK(share[PIECES / 2] > wanted[f], "median %g, wanted %g", share[PIECES / 2], wanted[f]);
        CHECK(t.worst > 0.95L, "the worst is %Lg tau", t.worst);
    }
}

/* Beside the frustum, too: eps is no less than most of the distance to it. */
static void what_is_not_drawn_may_be_as_wrong_as_its_gap(void **state) {
    (void)state;
    random_begin(__func__);
    double share[400];
    int count = 0;
    for (int n = 0; n < 400; n++) {
        const scene s = n % 4 ? random_scene(AROUND, 0) : piece_in_view(random_size(1, 120), random_size(0.2, 1));
        rqt_view_bound b;
        rqt_view_tolerance(&s.camera, &s.prism, &b);
        if (b.shown) continue;
        /* Their distance, from one to the other and back. */
        const piece ground = piece_from(&s.prism, s.camera.eye);
        point p = ground.centre, q = p;
        for (int round = 0; round < 30; round++) {
            q = nearest_drawn(&s.camera, p);
            p = nearest_in(&ground, q);
        }
        const double distance = (double)size_of(plus(p, -1, q));
        CHECK(b.eps < distance, "eps %g, distance %g", b.eps, distance);
        share[count++] = b.eps / distance;
    }
    qsort(share, (size_t)count, sizeof *share, by_size);
    print_message("%d pieces that are not shown: eps is %.3f of their distance (median; least %.3f)\n", count,
                  share[count / 2], share[0]);
    CHECK(count > 100 && share[count / 2] > 0.9 && share[count / 10] > 0.5, "%d: median %g, a tenth below %g",
          count, share[count / 2], share[count / 10]);
}

static void looking_down_on_upright_differences_allows_more(void **state) {
    (void)state;
    random_begin(__func__);
    double share[PIECES];
    for (int n = 0; n < PIECES; n++) {
        scene s = piece_in_view(60, 0);
        const piece ground = piece_from(&s.prism, s.camera.eye);
        const long double cosine = fabsl(inner(unit_of(ground.centre), ground.up)),
                          sine = sqrtl(1 - cosine * cosine);
        rqt_view_bound any, up;
        rqt_view_tolerance(&s.camera, &s.prism, &any);
        s.prism.upright = 1;
        rqt_view_tolerance(&s.camera, &s.prism, &up);
        /* As the sine of the angle, give or take what the piece is wide. */
        CHECK(up.eps >= any.eps && up.eps * (sine - 0.06L) <= any.eps &&
                  (sine > 0.94L || up.eps * (sine + 0.06L) > any.eps),
              "%g, %g, sine %Lg", any.eps, up.eps, sine);
        share[n] = up.eps / best_by_search(&s, up.eps);
    }
    qsort(share, PIECES, sizeof *share, by_size);
    print_message("differing upward and downward: eps is %.3f of the best possible (median; least %.3f)\n",
                  share[PIECES / 2], share[0]);
    CHECK(share[PIECES / 2] > 0.8, "median %g", share[PIECES / 2]);
}

static void near_and_far_end_what_is_shown(void **state) {
    (void)state;
    random_begin(__func__);
    int within = 0;
    for (int n = 0; n < 2000; n++) {
        scene s = piece_in_view(random_size(0.01, 60), 0);
        rqt_camera *c = &s.camera;
        const rqt_prism *p = &s.prism;
        rqt_view_bound all, b;
        rqt_view_tolerance(c, p, &all);
        /* Its depths, along the axis. */
        const point forward = point_of(c->forward);
        const long double cosine = inner(point_of(p->up), forward), sine = sqrtl(1 - cosine * cosine),
                          reach = p->half_height * fabsl(cosine) + p->radius * sine,
                          middle = inner(piece_from(p, c->eye).centre, forward), gap = reach / 2;
        c->far = (double)(middle - reach - gap);
        rqt_view_tolerance(c, p, &b);
        CHECK(!b.shown && b.eps > gap * 0.999L, "beyond far: eps %g, gap %Lg", b.eps, gap);
        c->far = (double)(middle * (1 + 1e-9L));
        rqt_view_tolerance(c, p, &b);
        CHECK(b.shown && b.eps == all.eps, "across far: eps %g of %g", b.eps, all.eps);
        c->far = INFINITY;
        c->near = (double)(middle + reach + gap);
        rqt_view_tolerance(c, p, &b);
        CHECK(!b.shown && b.eps > gap * 0.999L, "nearer than near: eps %g, gap %Lg", b.eps, gap);
        c->near = all.distance / 2;
        rqt_view_tolerance(c, p, &b);
        CHECK(b.shown && b.eps == all.eps, "farther than near: eps %g of %g", b.eps, all.eps);
        c->near = all.distance * 1.01;
        if (c->near > middle) continue;
        rqt_view_tolerance(c, p, &b);
        CHECK(b.shown && fabs(b.eps - all.eps * 1.01) < b.eps * 1e-9, "across near: eps %g of %g", b.eps, all.eps);
        within++;
    }
    CHECK(within > 100, "%d", within);
}

/* ---------------------------------------------------------------------------------------------- share -- */

static void share_says_what_splitting_could_win(void **state) {
    (void)state;
    random_begin(__func__);
    int won = 0, parts = 0;
    for (int n = 0; n < 4000; n++) {
        scene s = n % 2 ? random_scene(ANYWHERE, 0) : piece_in_view(random_size(1, 150), 0);
        rqt_view_bound whole, part;
        rqt_view_tolerance(&s.camera, &s.prism, &whole);
        if (!whole.shown) continue;
        const rqt_prism all = s.prism;
        const double less = random_between(0, 1) ? 0.5 : random_size(1e-3, 1);
        const point up = point_of(all.up), aside = unit_of(outer(up, random_direction()));
        s.prism.radius *= less;
        s.prism.half_height *= less;
        set_doubles(s.prism.centre, plus(plus(point_of(all.centre), (1 - less) * all.radius * random_unit(), aside),
                                         (1 - less) * all.half_height * (2 * random_unit() - 1), up));
        rqt_view_tolerance(&s.camera, &s.prism, &part);
        /* Centres are rounded. */
        CHECK(part.eps >= whole.eps * (1 - 1e-6) - 1e-6, "a part has %g, the whole %g", part.eps, whole.eps);
        if (!part.shown) continue;
        CHECK(part.eps * whole.share <= whole.eps * (1 + 1e-6) + 1e-6, "a part has %g, the whole %g, share %g",
              part.eps, whole.eps, whole.share);
        parts++;
        won += part.eps > whole.eps * 1.1;
    }
    CHECK(parts > 1000 && won > 200, "%d parts, %d of them with more", parts, won);

    scene s = piece_in_view(60, 0);
    rqt_view_bound b;
    rqt_view_tolerance(&s.camera, &s.prism, &b);
    const double twentieth = b.share;
    CHECK(twentieth > 0.75 && twentieth < 0.95, "a twentieth of the distance: %g", twentieth);
    s.prism.radius /= 50;
    s.prism.half_height /= 50;
    rqt_view_tolerance(&s.camera, &s.prism, &b);
    CHECK(b.share > 0.99 && b.share < 1, "a thousandth: %g", b.share);
    s.prism.half_height *= 5000;
    rqt_view_tolerance(&s.camera, &s.prism, &b);
    CHECK(b.share < 0.5, "a tower: %g", b.share);
    s = piece_in_view(60, 0.5);
    rqt_view_tolerance(&s.camera, &s.prism, &b);
    CHECK(!b.shown && b.share == 1, "beside the picture: %g", b.share);
    s.prism.radius *= 10;
    s.prism.half_height = s.prism.radius;
    rqt_view_tolerance(&s.camera, &s.prism, &b);
    CHECK(b.shown && b.share < 0.01, "across its border: %g", b.share);
}

/* -------------------------------------------------------------------------------------------- cameras -- */

static void cameras_are_at_right_angles_and_upright(void **state) {
    (void)state;
    random_begin(__func__);
    for (int n = 0; n < 3000; n++) {
        rqt_camera c = {.width = 640, .height = 480, .near = 0, .far = INFINITY, .tau = 1};
        const double scale = random_between(0, 3) ? 1 : pow(10, random_between(-300, 300));
        double eye[3], direction[3], vertical[3], ahead[3];
        set_doubles(eye, plus(NOWHERE, random_size(1, 1e9), random_direction()));
        const point d = random_direction();
        /* Now and then parallel, also to the one that does instead, also along an axis. */
        const int kind = random_between(0, 4);
        point v = random_direction(), a = random_direction();
        if (kind == 0) v = plus(plus(NOWHERE, random_between(0, 1) ? 1 : -1, d), random_size(1e-17, 1e-10), v);
        if (kind == 1) v = a = d;
        /* Nearly parallel: rounding must not cost the right angles. */
        if (kind == 2) v = unit_of(plus(d, random_size(2e-9, 1e-2), random_direction()));
        set_doubles(direction, plus(NOWHERE, scale, d));
        set_doubles(vertical, plus(NOWHERE, scale, v));
        set_doubles(ahead, plus(NOWHERE, scale, a));
        const double fovy = random_size(0.01, 179);
        rqt_message message = {""};
        CHECK(rqt_camera_look(&c, eye, direction, vertical, ahead, fovy, &message) == RQT_OK, "%s", message.text);
        const point f = point_of(c.forward), r = point_of(c.right), u = point_of(c.up);
        CHECK(fabsl(size_of(f) - 1) < 4e-16L && fabsl(size_of(r) - 1) < 4e-16L && fabsl(size_of(u) - 1) < 4e-16L,
              "not unit");
        CHECK(size_of(plus(outer(f, u), -1, r)) < 1e-15L, "right is not forward x up");
        CHECK(fabsl(inner(f, u)) < 1e-15L && fabsl(inner(r, u)) < 1e-15L && fabsl(inner(f, r)) < 1e-15L,
              "no right angles");
        CHECK(size_of(plus(f, -1, d)) < 1e-15L, "not along the direction");
        const long double sine = size_of(outer(d, v));
        if (kind > 1 && sine > 1e-9L)
            CHECK(fabsl(inner(r, v)) < 1e-15L && inner(u, v) > 0, "not upright: %Lg", inner(r, v));
        if (kind == 0)
            CHECK(fabsl(inner(r, a)) < 1e-15L / size_of(outer(d, a)) && inner(u, a) > 0, "not ahead: %Lg",
                  inner(r, a));
        /* The picture's upper and lower border are fovy apart. */
        const long double half = tanl(fovy * 0.00872664625997164788L);
        double xy[2];
        for (int side = -1; side <= 1; side++) {
            double there[3];
            c.eye[0] = c.eye[1] = c.eye[2] = 0;
            set_doubles(there, plus(plus(f, 0.999999L * side * half, u), 0.999999L * side * half * 4 / 3, r));
            CHECK(rqt_camera_project(&c, there, xy), "(%g,%g) is not drawn", xy[0], xy[1]);
            CHECK(fabs(xy[0] - (320 + 319.99968 * side)) < 1e-9 && fabs(xy[1] - (240 - 239.99976 * side)) < 1e-9,
                  "(%.12g,%.12g)", xy[0], xy[1]);
            set_doubles(there, plus(f, 1.000001L * half, side < 0 ? u : plus(NOWHERE, 4 / 3.0L, r)));
            CHECK(!rqt_camera_project(&c, there, xy) && (side < 0 ? xy[1] < 0 : xy[0] > 640), "(%g,%g) is drawn",
                  xy[0], xy[1]);
        }
    }
}

static void projection_agrees_and_says_what_is_drawn(void **state) {
    (void)state;
    random_begin(__func__);
    int drawn = 0, behind = 0;
    for (int n = 0; n < 20000; n++) {
        const scene s = random_scene(AROUND, 0);
        double there[3], xy[2] = {-7, -7};
        const piece ground = piece_from(&s.prism, (const double[3]){0, 0, 0});
        set_doubles(there, point_in(&ground));
        const point p = plus(point_of(there), -1, point_of(s.camera.eye));
        const seen wanted = look_at(&s.camera, p);
        const bool said = rqt_camera_project(&s.camera, there, xy);
        if (wanted.depth > 0) {
            const long double x = s.camera.width / 2 + wanted.x, y = s.camera.height / 2 - wanted.y,
                              size = size_of(p),
                              slack = 1e-14L * (size / wanted.depth) *
                                      (s.camera.focal + s.camera.width + fabsl(wanted.x) + fabsl(wanted.y));
            CHECK(fabsl(xy[0] - x) <= slack && fabsl(xy[1] - y) <= slack, "(%g,%g)", xy[0], xy[1]);
        } else {
            CHECK(isnan(xy[0]) && isnan(xy[1]) && !said, "(%g,%g), behind", xy[0], xy[1]);
            behind++;
        }
        /* By a hair they may differ. */
        if (wanted.drawn == look_at(&s.camera, plus(p, 1e-12L, p)).drawn &&
            fabsl(fabsl(wanted.x) - s.camera.width / 2) > 1e-6L &&
            fabsl(fabsl(wanted.y) - s.camera.height / 2) > 1e-6L)
            CHECK(said == wanted.drawn, "(%g,%g), depth %Lg of %g .. %g", xy[0], xy[1], wanted.depth, s.camera.near,
                  s.camera.far);
        drawn += said;
    }
    CHECK(drawn > 2000 && behind > 500, "%d drawn, %d behind", drawn, behind);
}

static void what_is_no_camera_is_refused(void **state) {
    (void)state;
    const rqt_camera good = {.width = 640, .height = 480, .near = 0, .far = INFINITY, .tau = 1};
    const double eye[3] = {1, 2, 3}, down[3] = {0, 0, -1}, up[3] = {0, 0, 1}, north[3] = {0, 1, 0},
                 none[3] = {0, 0, 0}, lost[3] = {0, NAN, 1}, endless[3] = {0, 0, INFINITY};
    rqt_camera c = good;
    rqt_message why;
    assert_int_equal(rqt_camera_look(&c, eye, down, up, north, 60, NULL), RQT_OK);
    assert_true(c.up[1] == 1 && c.right[0] == 1); /* north is up, east to the right */
#define REFUSED(sentence, change, e, d, v, a, fovy)                                 \
    do {                                                                            \
        c = good;                                                                   \
        change;                                                                     \
        memset(&why, 0, sizeof why);                                                \
        assert_int_equal(rqt_camera_look(&c, e, d, v, a, fovy, &why), RQT_INVALID); \
        CHECK(strstr(why.text, sentence), "%s", why.text);                          \
        assert_int_equal(rqt_camera_look(&c, e, d, v, a, fovy, NULL), RQT_INVALID); \
    } while (0)
    REFUSED("eye", (void)0, lost, down, up, north, 60);
    REFUSED("eye", (void)0, endless, down, up, north, 60);
    REFUSED("looks nowhere", (void)0, eye, none, up, north, 60);
    REFUSED("looks nowhere", (void)0, eye, endless, up, north, 60);
    REFUSED("vertical", (void)0, eye, down, none, north, 60);
    REFUSED("vertical", (void)0, eye, down, up, lost, 60);
    REFUSED("field of view", (void)0, eye, down, up, north, 0);
    REFUSED("field of view", (void)0, eye, down, up, north, 180);
    REFUSED("field of view", (void)0, eye, down, up, north, NAN);
    REFUSED("field of view is too small", (void)0, eye, down, up, north, 1e-320);
    REFUSED("picture", c.width = 0, eye, down, up, north, 60);
    REFUSED("picture", c.height = -1, eye, down, up, north, 60);
    REFUSED("picture", c.height = INFINITY, eye, down, up, north, 60);
    REFUSED("tolerance", c.tau = 0, eye, down, up, north, 60);
    REFUSED("tolerance", c.tau = INFINITY, eye, down, up, north, 60);
    REFUSED("near", c.near = -1, eye, down, up, north, 60);
    REFUSED("near", c.near = c.far = 5, eye, down, up, north, 60);
    REFUSED("near", c.far = NAN, eye, down, up, north, 60);
#undef REFUSED
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(cameras_are_at_right_angles_and_upright),
        TEST(projection_agrees_and_says_what_is_drawn),
        TEST(what_is_no_camera_is_refused),
        TEST(cameras_of_all_kinds),
        TEST(F31_eyes_inside_on_faces_and_far_away),
        TEST(F32_fields_of_view_from_hundredths_to_170_degrees),
        TEST(F33_straight_down),
        TEST(F34_far_from_the_origin_nothing_is_lost),
        TEST(what_is_not_drawn_may_be_as_wrong_as_its_gap),
        TEST(looking_down_on_upright_differences_allows_more),
        TEST(near_and_far_end_what_is_shown),
        TEST(share_says_what_splitting_could_win),
    };
    return cmocka_run_group_tests_name("views", tests, NULL, NULL);
}
