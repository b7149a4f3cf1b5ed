/* terrarium.c - the kind terrarium: heights as colours of PNG pictures, in Web Mercator, for MapLibre, deck.gl and
 * whatever else takes the tiles of Mapzen and AWS. Tiles z/x/y.png, y from the north, described by tile.json.
 *
 * Heights are as the terrain has them, mostly above the geoid: that is what these clients want, and so the vertical
 * datum is nobody's business here.
 *
 * Levels. The last is the first whose pixels are no wider than samples, where the terrain is nearest to the equator
 * and they are widest. A level's pixels are drawn from a mesh with vertices 2^shift samples apart, the most that is
 * no more than a pixel (of a pixel that is not square in samples, the square of its area): so what a tile takes
 * does not grow with the terrain, and a tile of the last levels is drawn from all samples.
 *
 * Heights are told in steps of a thousandth of a pixel's width, a power of two between 1/256 m and 1 m: finer ones
 * would be noise, of which half of a tile's bytes would be. The error that is told has them in it.
 *
 * Every tile that meets the raster is there, if all of it is void too: clients know nothing but bounds.
 */
#include "earth.h"
#include "terrarium.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <string.h>

#define MOST_LATITUDE 85.0511287798066 /* of the square that is the world */
#define STEPS 1024

static terrarium_plan *plan_of_pixels(const tiles *t) {
    return t->plan;
}

static int finest(const tiles *t) {
    return plan_of_pixels(t)->finest;
}

/* ------------------------------------------------------------------------------------------------- levels -- */

static double latitude_of(int z, int32_t y) {
    return atan(sinh(M_PI * (1 - 2 * y / ldexp(1, z)))) / DEGREE;
}

/* Rows of a level lie between lines 0 .. 2^z, from the north: the first line that is south of a latitude, or on it
 * if that counts; 2^z + 1: none. */
static int32_t find_line(int z, double latitude, bool counts) {
    int32_t low = 0, high = (1 << z) + 1;
    while (low < high) {
        const int32_t middle = low + (high - low) / 2;
        const double there = latitude_of(z, middle);
        if (there < latitude || (counts && there == latitude))
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

static int32_t clamp_tile(double n, int z) {
    const double count = ldexp(1, z);
    return (int32_t)(n < 0 ? 0 : n > count - 1 ? count - 1 : n);
}

/* The tiles of a level that meet the raster, turn by turn, those further west on the globe first. */
static int find_ranges(const store_terrain *t, int z, tile_range ranges[MOST_TURNS]) {
    const geo_extent e = tiles_extent(t);
    const double side = 360 / ldexp(1, z);
    int count = 0;
    tile_range next = {0};
    if (t->lattice.width < 2 || t->lattice.height < 2) return 0;
    const int32_t north = find_line(z, e.north, false), south = find_line(z, e.south, true);
    next.y0 = north > 0 ? north - 1 : 0;
    next.y1 = south > 1 << z ? (1 << z) - 1 : south - 1;
    if (next.y0 > next.y1) return 0;
    const int first = (int)floor((e.west - 180) / 360), last = (int)ceil((e.east + 180) / 360);
    for (int turn = last; turn >= first && count < MOST_TURNS; turn--) {
        const double west = e.west - 360.0 * turn, east = e.east - 360.0 * turn;
        if (east <= -180 || west >= 180) continue;
        next.x0 = clamp_tile(floor((west + 180) / side), z);
        next.x1 = clamp_tile(ceil((east + 180) / side) - 1, z);
        if (count > 0 && next.x0 <= ranges[count - 1].x1 + 1) {
            if (next.x1 > ranges[count - 1].x1) ranges[count - 1].x1 = next.x1;
            continue;
        }
        ranges[count++] = next;
    }
    return count;
}

static double clamp_latitude(double latitude) {
    return fmin(fmax(latitude, -MOST_LATITUDE), MOST_LATITUDE);
}

static int plan_create_pixels(tiles *t, void **out, char **error) {
    const store_terrain *terrain = t->terrain;
    const int code = tiles_check_place(terrain, error);
    if (code != SQLITE_OK) return code;
    terrarium_plan *plan = sqlite3_malloc(sizeof *plan);
    if (!plan) return SQLITE_NOMEM;
    *plan = (terrarium_plan){0};
    const geo_extent e = tiles_extent(terrain);
    const double north = clamp_latitude(e.north), south = clamp_latitude(e.south);
    const double nearest = south <= 0 && north >= 0 ? 0 : fmin(fabs(south), fabs(north));
    for (int z = 0; z < TILES_LEVELS; z++) {
        const double wide = 360 / ldexp(PIXELS, z) / e.lon_step,
                     high = 360 / ldexp(PIXELS, z) * cos(nearest * DEGREE) / e.lat_step;
        plan->finest = z;
        plan->shift[z] = (int)fmax(floor(log2(wide * high) / 2), 0);
        plan->step[z] = ldexp(1, (int)floor(log2(2 * M_PI * EARTH_A / ldexp(PIXELS, z) / STEPS)));
        plan->step[z] = fmin(fmax(plan->step[z], 1.0 / 256), 1);
        plan->range_count[z] = find_ranges(terrain, z, plan->ranges[z]);
        if (wide <= 1 && high <= 1) break;
    }
    *out = plan;
    return SQLITE_OK;
}

static int available(tiles *t, int series, int z, const tile_range **ranges, size_t *count, char **error) {
    (void)series;
    (void)error;
    *ranges = plan_of_pixels(t)->ranges[z];
    *count = (size_t)plan_of_pixels(t)->range_count[z];
    return SQLITE_OK;
}

/* -------------------------------------------------------------------------------------------------- tiles -- */

static int make(tiles *t, int series, int z, int32_t x, int32_t y, tile_bytes *out, char **error) {
    const terrarium_plan *plan = plan_of_pixels(t);
    bool is_there = false;
    (void)series;
    for (int i = 0; i < plan->range_count[z]; i++) {
        const tile_range *r = &plan->ranges[z][i];
        is_there |= x >= r->x0 && x <= r->x1 && y >= r->y0 && y <= r->y1;
    }
    if (!is_there) return SQLITE_OK;
    pixel_grid *g = sqlite3_malloc64(sizeof *g);
    if (!g) return SQLITE_NOMEM;
    pixels_place(t, z, x, y, plan->step[z], g);
    int code = plan->shift[z] == 0 ? samples_draw(t, g, error) : leaves_draw(t, plan->shift[z], g, error);
    if (code == SQLITE_OK) code = png_write(g, out);
    sqlite3_free(g);
    return code;
}

/* ----------------------------------------------------------------------------------------------- tile.json -- */

static int document(tiles *t, const char *root, int first, int last, tile_bytes *out, char **error) {
    char *address = sqlite3_mprintf("%s{z}/{x}/{y}.png", root);
    const char *const addresses[] = {address};
    (void)error;
    if (!address) return SQLITE_NOMEM;
    cJSON *json = cJSON_CreateObject();
    cJSON_AddStringToObject(json, "tilejson", "3.0.0");
    cJSON_AddStringToObject(json, "name", t->terrain->name);
    cJSON_AddStringToObject(json, "version", "1.0.0");
    cJSON_AddStringToObject(json, "scheme", "xyz");
    cJSON_AddItemToObject(json, "tiles", cJSON_CreateStringArray(addresses, 1));
    cJSON_AddNumberToObject(json, "minzoom", first);
    cJSON_AddNumberToObject(json, "maxzoom", last);
    tiles_add_bounds(t->terrain, MOST_LATITUDE, json);
    tiles_add_attribution(t->terrain, json);
    cJSON_AddStringToObject(json, "encoding", "terrarium");
    cJSON_AddNumberToObject(json, "tileSize", PIXELS);
    /* For people: what pixels are, and what is told of them. */
    cJSON_AddStringToObject(json, "heights", t->terrain->vertical[0] ? t->terrain->vertical : "as in the source");
    cJSON_AddItemToObject(json, "steps", cJSON_CreateDoubleArray(plan_of_pixels(t)->step, last + 1));
    cJSON_AddStringToObject(
        json, "error",
        "in each tile (PNG text error_metres): no sample whose four pixels around are not 0 m is "
        "further from their bilinear interpolation");
    cJSON_AddStringToObject(json, "void", "0 m (128, 0, 0), as nothing else is");
    sqlite3_free(address);
    return tiles_print(json, out);
}

static const tile_functions functions = {.plan_create = plan_create_pixels,
                                         .plan_free = sqlite3_free,
                                         .finest = finest,
                                         .available = available,
                                         .make = make,
                                         .document = document};

const tile_kind terrarium = {.name = "terrarium",
                             .document = "tile.json",
                             .has_addresses = true,
                             .series_count = 1,
                             .series = {{"", ".png", "image/png", true}},
                             .functions = &functions};
