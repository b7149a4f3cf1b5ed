"""Mutants of the query service: see ../mutants.py."""

SERVE, HOSTILE = "test_serve.py", "test_serve_hostile.py"

MUTANTS = [
    # what is answered
    ("serve: the region is left out", "src/serve/query.c", 'q->region = request_parameter(r, "wkt");', "q->region = NULL;", SERVE, "range as obj by wkt"),
    ("serve: a box is read from its end", "src/serve/query.c", "sqlite3_bind_double(make, i + 1, box[i]);", "sqlite3_bind_double(make, i + 1, box[3 - i]);", SERVE, "range as obj by bbox"),
    ("serve: options are not passed on", "src/serve/query.c", "q->options = whole ? strdup(whole) : NULL;", "q->options = strdup(\"{}\");", SERVE, "as JSON"),
    ("serve: single options are lost", "src/serve/query.c", "if (!is_option(p->name)) continue;", "continue;", SERVE, "as parameters"),
    ("serve: infinite errors are numbers", "src/serve/answer.c", 'buffer_text(b, "null");', 'buffer_text(b, "0");', SERVE, "infinite errors null"),
    ("serve: a triangle of GeoJSON is open", "src/serve/meshes.c", "corner < 4; corner++", "corner < 3; corner++", SERVE, "range as GeoJSON"),
    ("serve: the last column of what is told is lost", "src/serve/meshes.c", "for (int i = ROW_COLUMNS; i < columns && count == 0; i++)", "for (int i = ROW_COLUMNS + 1; i < columns && count == 0; i++)", SERVE,
     "JSON says the same"),
    ("serve: two databases of one name are mixed", "src/serve/documents.c", "if (name && !holds(collections,", "if (name || !holds(collections,", SERVE, "of one name the first one's"),
    # what is asked
    ("serve: a parameter may come twice", "src/serve/target.c", "if (request_parameter(r, next->name)) {", "if (0) {", SERVE, "eps=1&eps=2"),
    ("serve: any parameter is taken", "src/serve/endpoints.c", "if (!takes(r->endpoint, r->parameters[i].name)) {", "if (0) {", SERVE, "size=2"),
    ("serve: what is needed may be missing", "src/serve/endpoints.c", "if (request_parameter(r, name)) continue;", "continue;", SERVE, "/range: 400"),
    ("serve: overlong UTF-8 passes", "src/serve/target.c", "p[0] >= 0xC2 && p[0] < 0xE0", "p[0] >= 0xC0 && p[0] < 0xE0", SERVE, "%C0%80"),
    ("serve: a NUL ends a value", "src/serve/target.c", 'if (high == 0 && low == 0) return "holds a NUL";', "", SERVE, "%00"),
    ("serve: hexadecimal is a number", "src/serve/query.c", "    if (*p) return false;\n", "", SERVE, "0x10"),
    ("serve: a long target is read", "src/serve/target.c", "if (length > MOST_TARGET) {", "if (0) {", SERVE, "414"),
    ("serve: any method gets an answer", "src/serve/http.c", 'if (strcmp(r->method, "GET") != 0 && strcmp(r->method, "HEAD") != 0) {', "if (0) {", SERVE, "is not answered"),
    ("serve: a body is passed over", "src/serve/http.c", "if (!r->has_body) return MHD_YES;", "return MHD_YES;", SERVE, "with one"),
    # negotiation and tags
    ("serve: weights do not count", "src/serve/negotiate.c", "e->weight = read_weight(p + 2);", "e->weight = 1000;", SERVE, "Accept-Encoding"),
    ("serve: a weight of 0 is a yes", "src/serve/negotiate.c", "return weight[*c] > 0;", "return true;", SERVE, "nothing is acceptable"),
    ("serve: what is packed has the tag of what is not", "src/serve/endpoints.c", 'a->coding == CODING_IDENTITY ? "" : coding_name(a->coding)', '""', SERVE, "a tag of its own"),
    ("serve: a tag is not of the request", "src/serve/endpoints.c", "add_text(add_text(0xCBF29CE484222325u, RQT_VERSION), r->target)", "0xCBF29CE484222325u", SERVE, "a tag of its own"),
    ("serve: a file's time may be set back", "src/serve/database.c", "(int64_t)d->file.st_ctim.tv_sec, (int64_t)d->file.st_ctim.tv_nsec", "(int64_t)d->file.st_mtim.tv_sec, (int64_t)d->file.st_mtim.tv_nsec", SERVE, "a file that is written over, its time set back, has another tag"),
    ("serve: a tag does not know the log", "src/serve/database.c", "hash = add_to_hash(hash, index, INDEX_BYTES);", "", SERVE, "WAL: each commit has its tag"),
    ("serve: weak tags never match", "src/serve/negotiate.c", 'if (strncmp(p, "W/", 2) == 0) p += 2;', "", SERVE, "If-None-Match W/"),
    ("serve: errors are kept", "src/serve/answer.c", "*a = (answer){.status = status, .type", "*a = (answer){.is_lasting = true, .status = status, .type", SERVE, "kept by nobody"),
    ("serve: no CORS", "src/serve/http.c", 'put(response, MHD_HTTP_HEADER_ACCESS_CONTROL_ALLOW_ORIGIN, "*");', "", SERVE, "CORS of"),
    # limits, changes, the end
    ("serve: no limit of triangles", "src/serve/database.c", "sqlite3_bind_int64(limit, 1, most->max_triangles);", "sqlite3_bind_int64(limit, 1, 0);", SERVE, "413"),
    ("serve: no limit of samples", "ext/promise.c", "if (most > 0 && samples > (sqlite3_uint64)most) {", "if (0) {", SERVE, "verify?eps=400"),
    ("serve: a mesh over the limit is cut off", "src/store/budget.c", "if (code == SQLITE_OK && question->too_large && !question->over)", "if (0)", SERVE, "413"),
    ("serve: no limit of bytes", "src/serve/answer.c", "if (more > b->most - b->size) {", "if (0) {", SERVE, "f=geojson: 413"),
    ("serve: no limit of time", "src/serve/database.c", "return now_seconds() > d->deadline ||", "return", SERVE, "what takes too long"),
    ("serve: a replaced database is not noticed", "src/serve/database.c", "a->st_ino == b->st_ino &&", "1 ||", SERVE, "another database in its place"),
    ("serve: damage is the client's fault", "src/serve/answer.c", "    case SQLITE_CORRUPT:\n", "", SERVE, "500 with a sentence"),
    ("serve: one damaged database hides the others", "src/serve/documents.c", "if (failed < w->database_count) {", "if (!failed) {", SERVE, "does not hide"),
    ("serve: a folder is told", "src/serve/database.c", "slash ? slash + 1 : path", "path", SERVE, "tells no folder"),
    ("serve: the end does not wait", "src/serve/serve.c", "if (now > hurry || wait_for_signal(signals, LEAVING_MILLISECONDS)) pool_hurry(s->pool);", "pool_hurry(s->pool);", SERVE, "under way at SIGINT"),
    ("serve: slow clients stay", "src/serve/http.c", "if (p->phase != PEER_WAITS && now > p->until)", "if (0)", HOSTILE, "slow clients"),
    ("serve: a problem is no JSON", "src/serve/answer.c", "if (c >= 0x20 && c != '\"' && c != '\\\\') {", "if (c >= 0x20) {", HOSTILE, "whole and well formed"),
    ("serve: a proof goes on after its time", "ext/promise.c", "++p->asked % ASKED_AT_A_TIME == 0", "0", SERVE, "a proof ends with its time"),
    ("serve: answers that nobody reads take any memory", "src/serve/http.c", "const bool fits = size <= SMALL_ANSWER ||", "const bool fits = true ||", SERVE, "answers on their way take no more memory"),
    ("serve: the first of two lengths counts", "src/serve/http.c", "*(bool *)found = true;", "*(bool *)found = is_length;", SERVE, "no request hides"),
    ("serve: bytes that are no UTF-8 go out", "src/serve/answer.c", "buffer_text(b, \"\\uFFFD\");", "buffer_text(b, \"?\");", SERVE, "text that is no UTF-8 is marked"),
]
