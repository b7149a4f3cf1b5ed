/* error_kernels_cells.h - all small cells of a strip, eight at a time. Included by error_kernels.c once for each
 * processor.
 *
 * The strip's 256 columns are 8 lanes of 32: column 32*lane + phase is lane `lane` of vector `phase`. Then the
 * cells of side 2 .. 16 at one phase are alike in all lanes, their diagonals too, and the same sample of all of
 * them is one vector; what a triangle costs is a subtraction, an absolute value, a maximum and an addition a
 * sample, for eight.
 *
 * A cell of side c = 2^n has two halves, both of which count for its centre, and four quarters, one for each side's
 * midpoint. Heights times c less planes times c are integers. A row at distance t from the nearer horizontal side
 * runs, from west to east, through the west quarter (t samples), one sample on two quarters, the quarter of that
 * side, again one on two, and the east quarter; its halves meet at one of these two samples.
 */
enum { NAME(PHASES) = STRIP_COLUMNS / LANES };

typedef struct NAME(strip_lanes) {
    lanes_u z[STRIP_ROWS + 1][NAME(PHASES) + 1];   /* phase 32 is the next lane's 0 */
    lanes_u dev[STRIP_ROWS + 1][NAME(PHASES) + 1]; /* of the vertices there, times 2^n of the cells they are of */
    /* With voids, or with samples missing: all bits of the samples that are there; then, at the place of its first
     * sample, of the cells that have all of theirs. */
    lanes_u sound[STRIP_ROWS + 1][NAME(PHASES) + 1];
} NAME(strip_lanes);

/* --------------------------------------------------------------------------------- the layout, there and back */

#ifdef LANES_AVX2
/* 8 vectors of 8 values: rows become columns. */
static inline __attribute__((always_inline)) void transpose_avx2(__m256i v[8]) {
    __m256i a[8], b[8];
    for (int i = 0; i < 8; i += 2) {
        a[i] = _mm256_unpacklo_epi32(v[i], v[i + 1]);
        a[i + 1] = _mm256_unpackhi_epi32(v[i], v[i + 1]);
    }
    for (int i = 0; i < 8; i += 4) {
        b[i] = _mm256_unpacklo_epi64(a[i], a[i + 2]);
        b[i + 1] = _mm256_unpackhi_epi64(a[i], a[i + 2]);
        b[i + 2] = _mm256_unpacklo_epi64(a[i + 1], a[i + 3]);
        b[i + 3] = _mm256_unpackhi_epi64(a[i + 1], a[i + 3]);
    }
    for (int i = 0; i < 4; i++) {
        v[i] = _mm256_permute2x128_si256(b[i], b[i + 4], 0x20);
        v[i + 4] = _mm256_permute2x128_si256(b[i], b[i + 4], 0x31);
    }
}
#endif

/* A row of 257 samples as 33 vectors. */
static inline void NAME(lay_out)(const int32_t *row, lanes_u *to) {
#ifdef LANES_AVX2
    for (int phase = 0; phase < NAME(PHASES); phase += LANES) {
        __m256i v[LANES];
        for (int lane = 0; lane < LANES; lane++)
            v[lane] = _mm256_loadu_si256((const __m256i *)(row + lane * NAME(PHASES) + phase));
        transpose_avx2(v);
        for (int i = 0; i < LANES; i++) to[phase + i] = (lanes_u)v[i];
    }
#else
    for (int lane = 0; lane < LANES; lane++)
        for (int phase = 0; phase < NAME(PHASES); phase++)
            to[phase][lane] = (uint32_t)row[lane * NAME(PHASES) + phase];
#endif
    for (int lane = 0; lane < LANES; lane++) to[NAME(PHASES)][lane] = (uint32_t)row[(lane + 1) * NAME(PHASES)];
}

/* 33 vectors of codes, the last of which is of the vertices that begin the next lane, as a row of 257. */
static inline void NAME(lay_back)(const lanes_u *from, rqt_code *row) {
#ifdef LANES_AVX2
    for (int phase = 0; phase < NAME(PHASES); phase += 2 * LANES) {
        __m256i v[LANES];
        for (int i = 0; i < LANES; i++) v[i] = (__m256i)(from[phase + 2 * i] | from[phase + 2 * i + 1] << 16);
        transpose_avx2(v);
        for (int lane = 0; lane < LANES; lane++)
            _mm256_storeu_si256((__m256i *)(row + lane * NAME(PHASES) + phase), v[lane]);
    }
#else
    for (int lane = 0; lane < LANES; lane++)
        for (int phase = 0; phase < NAME(PHASES); phase++)
            row[lane * NAME(PHASES) + phase] = (rqt_code)from[phase][lane];
#endif
    row[STRIP_COLUMNS] = (rqt_code)from[NAME(PHASES)][LANES - 1];
}

/* The rows of a strip that lacks samples or has voids; those that are missing count as 0, and are not sound. */
static void NAME(lay_out_part)(const cell_strip *strip, NAME(strip_lanes) * s, int32_t row) {
    int32_t z[STRIP_COLUMNS + 1] = {0}, sound[STRIP_COLUMNS + 1] = {0};
    if (row < strip->rows) {
        const size_t at = (size_t)row * strip->stride;
        memcpy(z, strip->z + at, (size_t)strip->columns * sizeof *z);
        for (int32_t x = 0; x < strip->columns; x++)
            sound[x] = strip->valid && !strip->valid[at + (size_t)x] ? 0 : -1;
    }
    NAME(lay_out)(z, s->z[row]);
    NAME(lay_out)(sound, s->sound[row]);
}

/* ------------------------------------------------------------------------------------------------- one cell */

typedef struct NAME(cell_most) {
    lanes_u center, north, east, south, west;
} NAME(cell_most);

/* One row of a cell: z its samples, times c below. west_at, east_at: the planes at its ends; side_left, side_right:
 * the plane of the quarter at the horizontal side where the row enters and leaves it. left, right: slopes of the
 * halves. */
typedef struct NAME(cell_row) {
    lanes_u west_at, east_at, side_left, side_right;
} NAME(cell_row);

typedef struct NAME(cell_slopes) {
    lanes_u left, right;      /* of the half in the west, and in the east */
    lanes_u west, east, side; /* of the quarters, eastwards */
} NAME(cell_slopes);

#define DEVIATION(plane) LANES_ABS((lanes_i)(height - (plane)))
#define RAISE(most, deviation) (most) = LANES_MAX(most, deviation)

static inline __attribute__((always_inline)) void NAME(measure_row)(const lanes_u *z, const NAME(cell_row) * at,
                                                                    const NAME(cell_slopes) * g, const int n,
                                                                    const int t, const bool right_in_middle,
                                                                    lanes_u *center, lanes_u *west, lanes_u *east,
                                                                    lanes_u *side) {
    const int c = 1 << n;
    lanes_u half = at->west_at, quarter = at->west_at;
    for (int x = 0; x < t; x++) {
        const lanes_u height = z[x] << n;
        RAISE(*center, DEVIATION(half));
        RAISE(*west, DEVIATION(quarter));
        half += g->left;
        quarter += g->west;
    }
    lanes_u half_east = at->east_at, quarter_east = at->east_at;
    for (int x = c; x > c - t; x--) {
        const lanes_u height = z[x] << n;
        RAISE(*center, DEVIATION(half_east));
        RAISE(*east, DEVIATION(quarter_east));
        half_east -= g->right;
        quarter_east -= g->east;
    }
    if (2 * t == c) { /* the centre itself: on all quarters */
        const lanes_u height = z[t] << n;
        RAISE(*center, DEVIATION(half));
        return;
    }
    if (t > 0) { /* the ends of the middle are on two quarters; where t is 0 they are corners */
        lanes_u height = z[t] << n;
        RAISE(*west, DEVIATION(quarter));
        height = z[c - t] << n;
        RAISE(*east, DEVIATION(quarter_east));
    }
    if (right_in_middle) {
        lanes_u plane = at->side_right;
        for (int x = c - t; x >= t; x--) {
            const lanes_u height = z[x] << n;
            RAISE(*center, DEVIATION(half_east));
            RAISE(*side, DEVIATION(plane));
            half_east -= g->right;
            plane -= g->side;
        }
    } else {
        lanes_u plane = at->side_left;
        for (int x = t; x <= c - t; x++) {
            const lanes_u height = z[x] << n;
            RAISE(*center, DEVIATION(half));
            RAISE(*side, DEVIATION(plane));
            half += g->left;
            plane += g->side;
        }
    }
}

/* The cell at (phase, row) of a strip. anti: its diagonal runs from south-west to north-east. */
static inline __attribute__((always_inline)) NAME(cell_most)
    NAME(measure_lanes)(lanes_u (*z)[NAME(PHASES) + 1], const int phase, const int n, const bool anti) {
    const int c = 1 << n;
    const lanes_u nw = z[0][phase], ne = z[0][phase + c], sw = z[c][phase], se = z[c][phase + c];
    const lanes_u twice = 2 * z[c / 2][phase + c / 2];
    const lanes_u top = ne - nw, bottom = se - sw, down_west = sw - nw, down_east = se - ne;
    NAME(cell_slopes) north = {.left = anti ? top : bottom, .right = anti ? bottom : top};
    north.west = twice - nw - sw;
    north.east = ne + se - twice;
    NAME(cell_slopes) south = north;
    north.side = top;
    south.side = bottom;
    const lanes_u into_north = twice - nw - ne, into_south = twice - sw - se;
    NAME(cell_row) upper = {nw << n, ne << n, nw << n, ne << n}, lower = {sw << n, se << n, sw << n, se << n};
    NAME(cell_most) most = {{0}, {0}, {0}, {0}, {0}};
    for (int t = 0; t < c / 2; t++) {
        NAME(measure_row)
        (z[t] + phase, &upper, &north, n, t, !anti, &most.center, &most.west, &most.east, &most.north);
        NAME(measure_row)
        (z[c - t] + phase, &lower, &south, n, t, anti, &most.center, &most.west, &most.east, &most.south);
        upper.west_at += down_west;
        upper.east_at += down_east;
        upper.side_left += into_north + top;
        upper.side_right += into_north - top;
        lower.west_at -= down_west;
        lower.east_at -= down_east;
        lower.side_left += into_south + bottom;
        lower.side_right += into_south - bottom;
    }
    NAME(measure_row)
    (z[c / 2] + phase, &upper, &north, n, c / 2, false, &most.center, &most.west, &most.east, &most.north);
    return most;
}

/* All cells of side 2^n of a strip of 2^levels rows. */
static inline __attribute__((always_inline)) void
NAME(measure_level)(NAME(strip_lanes) * s, const cell_strip *strip, const int n, const bool part) {
    const int c = 1 << n, half = c / 2;
    for (int row = 0; row < 1 << strip->levels; row += c)
        for (int phase = 0; phase < NAME(PHASES); phase += c) {
            const bool anti = ((strip->x + phase) ^ (strip->y + row)) >> n & 1;
            NAME(cell_most)
            most = anti ? NAME(measure_lanes)(s->z + row, phase, n, true)
                        : NAME(measure_lanes)(s->z + row, phase, n, false);
            if (part) {
                lanes_u sound = s->sound[row][phase] & s->sound[row][phase + half] & s->sound[row + half][phase] &
                                s->sound[row + half][phase + half];
                if (n == 1) {
                    for (int i = 0; i <= c; i++)
                        sound &= s->sound[row + c][phase + i] & s->sound[row + i][phase + c];
                }
                s->sound[row][phase] = sound;
                most.center &= sound;
                most.north &= sound;
                most.east &= sound;
                most.south &= sound;
                most.west &= sound;
            }
            s->dev[row + half][phase + half] = most.center;
            RAISE(s->dev[row][phase + half], most.north);
            RAISE(s->dev[row + c][phase + half], most.south);
            RAISE(s->dev[row + half][phase], most.west);
            RAISE(s->dev[row + half][phase + c], most.east);
        }
}

/* ---------------------------------------------------------------------------------------------------- codes */

/* What codes are made with: deviations are exact floats or, beyond 2^24, are rounded up to such first; times a
 * factor between 1 and 2 that is exact or near within 2^-24; times a power of two that is a term of the code. */
typedef struct NAME(code_lanes) {
    const code_scale *scale;
    float factor;
    uint32_t round; /* 127: round deviations up to multiples of 128, where they are large */
    uint32_t slack; /* of the bits of the product */
    int32_t bias;   /* of codes, with n = 0 */
} NAME(code_lanes);

static NAME(code_lanes) NAME(code_lanes_of)(const code_scale *scale) {
    int exponent;
    const double mantissa = 2 * frexp(scale->factor, &exponent);
    return (NAME(code_lanes)){.scale = scale,
                              .factor = (float)mantissa,
                              .round = scale->exact ? 127 : 0,
                              .slack = scale->exact ? 0 : 8,
                              .bias = 16512 + 128 * (exponent - 1)};
}

/* The codes of deviations below 2^31 / 2^n quanta, as code_of_binary gives them. */
static inline __attribute__((always_inline)) lanes_u NAME(codes_of)(const NAME(code_lanes) * k, lanes_u deviation,
                                                                    int n) {
    const lanes_i large = (lanes_i)deviation > 0xFFFFFF;
    const lanes_u round = (lanes_u)large & k->round;
    const lanes_i rounded = (lanes_i)((deviation + round) & ~round);
    const lanes_f near = __builtin_convertvector(rounded, lanes_f) * k->factor;
    const lanes_u bits = (lanes_u)near, some = (lanes_u)(deviation != 0);
    const uint32_t bias = (uint32_t)(k->bias - 128 * n);
    const lanes_u high = (((bits + (0xFFFF + k->slack)) >> 16) + bias) & some;
    if (k->slack) {
        const lanes_u low = (((bits + (0xFFFF - k->slack)) >> 16) + bias) & some;
        if (LANES_ANY(low ^ high)) {
            lanes_u exact = high;
            for (int i = 0; i < LANES; i++)
                if (low[i] != high[i]) exact[i] = code_of_binary(k->scale, deviation[i], n);
            return exact;
        }
    }
    return high;
}

/* Row `row` of the strip's vertices, raised in row-major order. */
static void NAME(raise_row)(NAME(strip_lanes) * s, const cell_strip *strip, const NAME(code_lanes) * k, int row) {
    lanes_u code[NAME(PHASES) + 1];
    rqt_code line[STRIP_COLUMNS + 1];
    /* The last vertex of a lane is the first one of the next. */
    for (int lane = LANES - 1; lane > 0; lane--)
        if (s->dev[row][NAME(PHASES)][lane - 1] > s->dev[row][0][lane])
            s->dev[row][0][lane] = s->dev[row][NAME(PHASES)][lane - 1];
    for (int phase = 0; phase <= NAME(PHASES); phase++)
        code[phase] =
            NAME(codes_of)(k, s->dev[row][phase], __builtin_ctz((unsigned)(phase | row | 1 << strip->levels)) + 1);
    NAME(lay_back)(code, line);
    rqt_code *const to = strip->code + (size_t)row * strip->code_stride;
    for (int32_t x = 0; x < strip->columns; x++) to[x] = line[x] > to[x] ? line[x] : to[x];
}

static void NAME(cells)(const cell_strip *strip, const code_scale *scale) {
    NAME(strip_lanes) s;
    const int side = 1 << strip->levels;
    const NAME(code_lanes) k = NAME(code_lanes_of)(scale);
    const bool part = strip->valid || strip->columns < STRIP_COLUMNS + 1 || strip->rows < side + 1;
    for (int row = 0; row <= side; row++) {
        if (part)
            NAME(lay_out_part)(strip, &s, row);
        else
            NAME(lay_out)(strip->z + (size_t)row * strip->stride, s.z[row]);
        memset(s.dev[row], 0, sizeof s.dev[row]);
    }
    for (int n = 1; n <= strip->levels; n++) switch (part ? -n : n) {
        case 1:
            NAME(measure_level)(&s, strip, 1, false);
            break;
        case 2:
            NAME(measure_level)(&s, strip, 2, false);
            break;
        case 3:
            NAME(measure_level)(&s, strip, 3, false);
            break;
        case 4:
            NAME(measure_level)(&s, strip, 4, false);
            break;
        case -1:
            NAME(measure_level)(&s, strip, 1, true);
            break;
        case -2:
            NAME(measure_level)(&s, strip, 2, true);
            break;
        case -3:
            NAME(measure_level)(&s, strip, 3, true);
            break;
        default:
            NAME(measure_level)(&s, strip, 4, true);
        }
    for (int row = 0; row <= side && row < strip->rows; row++) NAME(raise_row)(&s, strip, &k, row);
}

#undef DEVIATION
#undef RAISE
