"""Mutants of the tiles for maps: see ../mutants.py."""

TERRARIUM = "test_terrarium.py"
KIND, PIXELS, SAMPLES, PROOF, PNG = ("src/tiles/terrarium/%s.c" % name for name in ("terrarium", "pixels", "samples", "proof", "png"))
SERVE = "src/serve/tiles.c"

MUTANTS = [
    # the error
    ("terrarium: leaves have no error of their own", PROOF, "here.bound = off < 0 ? -1 : off + p->l.floor;", "here.bound = off;", TERRARIUM, "the stated error holds"),
    ("terrarium: the smallest bound gives way first", PROOF, "p->parts[(at - 1) / 2].bound < new.bound;", "p->parts[(at - 1) / 2].bound > new.bound;", TERRARIUM, "the stated error holds"),
    ("terrarium: boxes never give way to their children", PROOF, "MOST_SPLITS = 1200", "MOST_SPLITS = 0", TERRARIUM, "times the true one"),
    ("terrarium: two children are not looked at", PROOF, "x % cells + size, y % cells, y % cells + size}", "x % cells + size / 2, y % cells, y % cells + size}", TERRARIUM, "the stated error holds"),
    ("terrarium: all samples are not measured", SAMPLES, "if (off > most) most = off;", "if (off > most && y % 2) most = off;", TERRARIUM, "the stated error holds"),
    ("terrarium: rows of pixels are even in latitude", SAMPLES, "const double n = (top - next) / (2 * M_PI) * ldexp(PIXELS, g->z);",
     "const double n = (g->lat[0] - lat) / (g->lat[0] - g->lat[GRID - 1]) * (GRID - 1) + 0 * (top - next);", TERRARIUM, "the stated error holds"),
    ("terrarium: the neighbours' pixels do not count", SAMPLES, "if (!g->is_whole[at] ||", "if (!g->is_whole[at] || i[n] == 0 || j == 0 || i[n] > PIXELS - 1 || j > PIXELS - 1 ||", TERRARIUM,
     "the stated error holds"),
    # heights
    ("terrarium: pixels are at corners", PIXELS, "g->lon[i] = (first_x + i + 0.5) * 360", "g->lon[i] = (first_x + i) * 360", TERRARIUM, "the stated error holds"),
    ("terrarium: the other diagonal", SAMPLES, "if ((x + y) % 2 == 0) {", "if ((x + y) % 2 == 1) {", TERRARIUM, "rqt_height's"),
    ("terrarium: land at 0 m is void", PIXELS, "if (code == NO_HEIGHT) return", "if (code == NO_HEIGHT && metres > 1) return", TERRARIUM, "a step above 0"),
    ("terrarium: colours wrap", PIXELS, "(n < 0 ? 0 : n > most ? most : n);", "(n < 0 ? n + most : n > most ? n - most : n);", TERRARIUM, "no more than it has to"),
    ("terrarium: longitudes count once", PIXELS, "*last = (int)ceil((e.east - g->lon[0]) / 360);", "*last = 0;", TERRARIUM, "turned"),
    # which there are, and bytes
    ("terrarium: one level less", KIND, "if (wide <= 1 && high <= 1) break;", "if (wide <= 2 && high <= 2) break;", TERRARIUM, "no wider than samples"),
    ("terrarium: rows are counted from the south", KIND, "y >= r->y0 && y <= r->y1;", "(1 << z) - 1 - y >= r->y0 && (1 << z) - 1 - y <= r->y1;", TERRARIUM, "meet the raster"),
    ("terrarium: all of the world is there", KIND, "if (!is_there) return SQLITE_OK;", "", TERRARIUM, "are not there"),
    ("terrarium: voids are not counted", PNG, "count += g->code[j * GRID + i] == NO_HEIGHT;", "count += 0;", TERRARIUM, "void pixels are counted"),
    ("terrarium: names of files are HTML", "src/tiles/tiles.c", "if (strchr(\"<>&\\\"'\", *p))", "if (*p == 1)", TERRARIUM, "no HTML"),
    # addresses
    ("terrarium: any host will do", SERVE, "if (!isalnum((unsigned char)given[i]) && !strchr(others, given[i])) return;", "if (given[i] == 1) return;", TERRARIUM, "no host's name"),
    ("terrarium: servers before us name no folder", SERVE, 'read_header(r, "X-Forwarded-Prefix", "-._~/", prefix);', "prefix[0] = 0;", TERRARIUM, "as a server before us says"),
]
