/* command_mesh.c - rqt mesh: the mesh of a region as a file. The file's ending says which kind:
 *
 *   .obj .ply .glb   the bytes of SQL's rqt_mesh()
 *   .gpkg            a layer of triangles (layer.c)
 *   .svg .png        a picture (the room picture); a list of eps makes a panel of each
 */
#include "cli.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char HELP[] =
    "rqt mesh: the mesh of a region, nowhere further than eps from the samples, as a file\n"
    "\n"
    "Usage: rqt mesh DATABASE --eps E [OPTION...] -o FILE\n"
    "\n"
    "The ending of FILE says what it will be:\n"
    "  .obj .ply       a model: x, y in the terrain's coordinates, z in metres, up; .ply is a mesh layer to QGIS\n"
    "  .glb            glTF 2.0: a model in metres about an origin that the file tells, y up, north along -z\n"
    "  .gpkg           a GeoPackage with a layer of 3D triangles, for QGIS and OGR\n"
    "  .svg .png       a picture: shaded relief and the mesh over it, with its true error; a panel for each eps\n"
    "\n"
    "Options:\n"
    "  --eps E         tolerance in metres of height; for pictures a list, too: 5,20,80\n"
    "  --region R      x0,y0,x1,y1 or WKT, in the terrain's coordinates (default: all)\n"
    "  --terrain T     which terrain (default: the only one)\n"
    "  --normals       with the terrain's normal at each vertex, from its full-resolution samples; for .ply\n"
    "                  and .glb\n"
    "  --quantized     positions in 16 bits (KHR_mesh_quantization); for .glb\n"
    "  --mode M        what happens at the region's border: cover, the default: every triangle that has a part of\n"
    "                  its inside in the region, whole; snap: the same of the region grown to squares of a power "
    "of\n"
    "                  two of samples; border: triangles are split along it, down to half cells of the samples; "
    "cut:\n"
    "                  triangles are clipped to the region\n"
    "  --outline O     of voids: exact, the default, or tol: moved by no more than eps * --void-tol of the import\n"
    "  -o, --output F  the file; it is replaced when it exists, and only by a whole one\n"
    "  --width W       width of a picture in pixels, 1200 to 12000 (default 1800)\n"
    "  --help          this text\n"
    "\n"
    "Examples:\n"
    "  rqt mesh washington.gpkg --eps 5,20,80 -o washington.png\n"
    "  rqt mesh washington.gpkg --eps 5 --region -71.4,44.2,-71.2,44.4 -o summit.obj\n"
    "  rqt mesh washington.gpkg --eps 5 --normals -o summit.glb\n"
    "  rqt mesh mountains.gpkg --terrain pyrenees --eps 10 -o triangles.gpkg\n";

enum { DEFAULT_WIDTH = 1800, LEAST_WIDTH = 1200, LARGEST_WIDTH = 12000 };

static const struct option OPTIONS[] = {{"eps", required_argument, NULL, 'e'},
                                        {"region", required_argument, NULL, 'r'},
                                        {"terrain", required_argument, NULL, 't'},
                                        {"mode", required_argument, NULL, 'm'},
                                        {"output", required_argument, NULL, 'o'},
                                        {"width", required_argument, NULL, 'w'},
                                        {"normals", no_argument, NULL, 'n'},
                                        {"quantized", no_argument, NULL, 'q'},
                                        {"outline", required_argument, NULL, 'O'},
                                        {"help", no_argument, NULL, 'h'},
                                        {NULL, 0, NULL, 0}};

typedef enum kind { NO_KIND, OBJ, PLY, GLB, GPKG, SVG, PNG } kind;

typedef struct request {
    const char *database, *terrain, *region, *output;
    cli_answer_options answer;
    const char *options; /* of the SQL functions, JSON */
    double eps[CLI_MAX_EPS];
    int count, width;
    bool normals, quantized;
    kind kind;
} request;

static kind kind_of(const char *path) {
    static const struct {
        const char *ending;
        kind kind;
    } kinds[] = {{".obj", OBJ}, {".ply", PLY}, {".glb", GLB}, {".gpkg", GPKG}, {".svg", SVG}, {".png", PNG}};
    const size_t n = strlen(path);
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        const size_t m = strlen(kinds[i].ending);
        if (n > m && !strcasecmp(path + n - m, kinds[i].ending)) return kinds[i].kind;
    }
    cli_usage("%s: the file ends in .obj, .ply, .glb, .gpkg, .svg or .png", path);
    return NO_KIND;
}

/* The bytes of SQL's rqt_mesh. */
static int write_bytes(sqlite3 *db, const request *r, const char *region, const cli_output *output) {
    sqlite3_stmt *row = cli_prepare(db, "SELECT rqt_mesh(?1, ?2, ?4, ?3, ?5)");
    if (!row) return CLI_FAILED;
    cli_bind_query(row, region, r->eps[0], r->terrain);
    char format[32];
    snprintf(format, sizeof format, "%s%s%s",
             r->kind == OBJ   ? "obj"
             : r->kind == PLY ? "ply"
                              : "glb",
             r->quantized ? "+quantized" : "", r->normals ? "+normals" : "");
    sqlite3_bind_text(row, 4, format, -1, SQLITE_STATIC);
    sqlite3_bind_text(row, 5, r->options, -1, SQLITE_STATIC);
    int status = CLI_FAILED;
    if (sqlite3_step(row) == SQLITE_ROW) {
        const void *bytes = sqlite3_column_blob(row, 0);
        const int size = sqlite3_column_bytes(row, 0);
        if (cli_output_write(output, bytes, (size_t)size)) status = CLI_OK;
    } else {
        cli_fail_database(db);
    }
    sqlite3_finalize(row);
    return status;
}

static int mesh(sqlite3 *db, const request *r, const char *region) {
    cli_output output;
    const int refused = cli_output_begin(&output, r->output, r->database);
    if (refused) return refused;
    int status;
    if (r->kind == GPKG)
        status = cli_write_layer(db, region, r->eps[0], r->terrain, r->options, &output);
    else if (r->kind == OBJ || r->kind == PLY || r->kind == GLB)
        status = write_bytes(db, r, region, &output);
    else
        status = cli_write_picture(db,
                                   &(picture_request){.region = region,
                                                      .eps = r->eps,
                                                      .count = r->count,
                                                      .terrain = r->terrain,
                                                      .options = r->options,
                                                      .width = r->width,
                                                      .svg = r->kind == SVG},
                                   &output);
    if (status == CLI_OK) return cli_output_finish(&output) ? CLI_OK : CLI_FAILED;
    cli_output_discard(&output);
    return status;
}

static int set_option(request *r, int option) {
    int64_t n;
    switch (option) {
    case 'e':
        r->count = cli_eps(optarg, r->eps);
        return r->count ? CLI_OK : CLI_USAGE;
    case 'r':
        r->region = optarg;
        return CLI_OK;
    case 't':
        r->terrain = optarg;
        return CLI_OK;
    case 'm':
        return cli_set_mode(&r->answer, optarg);
    case 'O':
        return cli_set_outline(&r->answer, optarg);
    case 'o':
        r->output = optarg;
        return CLI_OK;
    case 'n':
        r->normals = true;
        return CLI_OK;
    case 'q':
        r->quantized = true;
        return CLI_OK;
    case 'w':
        if (!cli_integer(optarg, LEAST_WIDTH, LARGEST_WIDTH, &n))
            return cli_usage("--width %s: a whole number of pixels from %d to %d", optarg, LEAST_WIDTH,
                             LARGEST_WIDTH);
        r->width = (int)n;
        return CLI_OK;
    default:
        return CLI_USAGE; /* cli_option has said why */
    }
}

static int run(int argc, char **argv) {
    request r = {.width = DEFAULT_WIDTH};
    for (int option; (option = cli_option(argc, argv, "ho:", OPTIONS)) != -1;) {
        if (option == 'h') return cli_help(HELP);
        const int status = set_option(&r, option);
        if (status != CLI_OK) return status;
    }
    if (argc - optind != 1)
        return argc == optind ? cli_usage("a database is missing") : cli_usage("one database at a time");
    r.database = argv[optind];
    r.options = cli_options_json(&r.answer);
    if (!r.count) return cli_usage("--eps is missing: the tolerance in metres");
    if (!r.output) return cli_usage("-o is missing: the file to write");
    if ((r.kind = kind_of(r.output)) == NO_KIND) return CLI_USAGE;
    if (r.normals && r.kind != PLY && r.kind != GLB)
        return cli_usage("%s holds no normals; a .ply or a .glb does", r.output);
    if (r.quantized && r.kind != GLB) return cli_usage("%s is not quantized; a .glb can be", r.output);
    if (r.count > 1 && r.kind != SVG && r.kind != PNG)
        return cli_usage("%s holds one mesh, so --eps takes one number here; a list is for .svg and .png",
                         r.output);
    char *region = NULL;
    if (r.region && !(region = cli_region(r.region))) return CLI_USAGE;
    sqlite3 *db = cli_open(r.database);
    const int status = db ? mesh(db, &r, region) : CLI_FAILED;
    sqlite3_close(db);
    free(region);
    return status;
}

const cli_command command_mesh = {"mesh", "a mesh as obj, ply, glb, gpkg, svg or png", run};
