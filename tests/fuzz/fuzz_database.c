/* fuzz_database.c - databases that an enemy has made: any bytes of the file changed, rows edited, tables replaced
 * by views, generated columns and tables of other shapes; trusted_schema on and off. Every question then ends with
 * an answer or a sentence, and changes nothing. */
#include "fuzz_store.h"

/* Each is tried, and may fail: some need what others have taken away. */
static const char *const edits[] = {
    "UPDATE rqt_terrain SET %s = %s",
    "UPDATE rqt_block_1 SET data = (SELECT data FROM rqt_block_2 LIMIT 1) WHERE id %% 3 = 0",
    "UPDATE rqt_block_1 SET summary = (SELECT summary FROM rqt_block_2 LIMIT 1) WHERE id = 1",
    "UPDATE rqt_block_1 SET data = zeroblob(2000000) WHERE id > 60",
    "UPDATE rqt_index_1 SET x1 = x0",
    "UPDATE rqt_index_1_node SET data = randomblob(length(data))",
    "UPDATE rqt_index_1_node SET data = zeroblob(4)",
    "DELETE FROM rqt_block_1 WHERE id %% 2",
    "INSERT INTO rqt_index_1 SELECT id + 7, x0, x1, y0, y1, 0, 65535, 0, 65535 FROM rqt_index_1",
    "CREATE TABLE b AS SELECT * FROM rqt_block_1; DROP TABLE rqt_block_1; CREATE VIEW rqt_block_1 AS SELECT * FROM "
    "b",
    "CREATE TABLE b AS SELECT * FROM rqt_block_1; DROP TABLE rqt_block_1;"
    "CREATE VIEW rqt_block_1 AS SELECT id, summary, CASE WHEN rqt_height(2, -2) THEN data END AS data FROM b",
    "DROP TABLE rqt_block_1; CREATE VIEW rqt_block_1 AS SELECT id, data, summary FROM rqt_block_1",
    "DROP TABLE rqt_block_1; CREATE VIEW rqt_block_1 AS WITH RECURSIVE r(n) AS (SELECT 1 UNION ALL SELECT n FROM "
    "r) "
    "SELECT n AS id, zeroblob(80) AS summary, zeroblob(80) AS data FROM r",
    "DROP TABLE rqt_block_1; CREATE TABLE rqt_block_1(id INTEGER PRIMARY KEY, summary GENERATED ALWAYS AS "
    "(randomblob(80)), data)",
    "DROP TABLE rqt_block_1; CREATE TABLE rqt_block_1(id TEXT, summary TEXT, data TEXT);"
    "INSERT INTO rqt_block_1 VALUES('1', 'RQTS', 'RQTB'), (NULL, NULL, NULL), (1, 1e9, 2)",
    "CREATE TABLE i AS SELECT * FROM rqt_index_1; DROP TABLE rqt_index_1; ALTER TABLE i RENAME TO rqt_index_1",
    "DROP TABLE rqt_index_1; CREATE VIEW rqt_index_1 AS SELECT value AS id, 0 AS x0, 99 AS x1, 0 AS y0, 99 AS y1, "
    "0 AS tol0, "
    "65535 AS tol1, 0 AS exact0, 65535 AS exact1 FROM json_each('[1,2,3,4,5,6,7]')",
    "DROP TABLE rqt_index_1; CREATE VIRTUAL TABLE rqt_index_1 USING rtree(id, x0, x1, y0, y1)",
    "CREATE TABLE t AS SELECT * FROM rqt_terrain; DROP TABLE rqt_terrain; CREATE VIEW rqt_terrain AS SELECT * FROM "
    "t",
    "CREATE TABLE t AS SELECT * FROM rqt_terrain; DROP TABLE rqt_terrain;"
    "CREATE VIEW rqt_terrain AS SELECT t.* FROM t, rqt_terrains WHERE 1",
    "DROP TABLE rqt_terrain; CREATE TABLE rqt_terrain(id, name); INSERT INTO rqt_terrain VALUES(1, 'hills')",
    "CREATE TRIGGER x AFTER UPDATE ON rqt_terrain BEGIN DELETE FROM rqt_block_1; END",
    "INSERT INTO rqt_terrain SELECT id + 100, name || id, * FROM (SELECT * FROM rqt_terrain)",
    "CREATE VIEW v AS SELECT rqt_height(-71.3, 44.3, 0, 'hills') AS h, rqt_block_check(randomblob(50)) AS c",
};
static const char *const columns[] = {"id",
                                      "name",
                                      "format",
                                      "complete",
                                      "width",
                                      "height",
                                      "k",
                                      "x0",
                                      "y0",
                                      "dx",
                                      "dy",
                                      "z0",
                                      "d",
                                      "unit_numerator",
                                      "scale",
                                      "srid",
                                      "unit_denominator",
                                      "height_offset",
                                      "cell",
                                      "void_tol",
                                      "quantum_error",
                                      "lonlat",
                                      "wgs84",
                                      "voids",
                                      "min_q",
                                      "max_q",
                                      "blocks",
                                      "max_error"};
static const char *const questions[] = {
    "SELECT * FROM rqt_terrains",
    "SELECT * FROM rqt_range(NULL, 0, 'hills')",
    "SELECT * FROM rqt_range('POLYGON((-71.4 44.2, -71.2 44.2, -71.3 44.4, -71.4 44.2))', 5, 'hills', "
    "'{\"select\":\"bottomup\"}')",
    "SELECT * FROM rqt_triangles(NULL, 3, 'hills', '{\"metric\":\"minimal\"}')",
    "SELECT * FROM rqt_verify(NULL, 2, 'hills')",
    "SELECT * FROM rqt_explain(NULL, 2, 'hills')",
    "SELECT rqt_height(-71.3, 44.3, 0, 'hills'), rqt_height(-71.3, 44.3, 3, 'hills')",
    "SELECT rqt_mesh(NULL, 3, 'rqt', 'hills'), rqt_mesh(NULL, 3, 'strip', 'hills')",
    "SELECT rqt_delta(NULL, 9, 3, 'hills')",
    "SELECT * FROM rqt_check()",
    "SELECT * FROM rqt_check('plain')",
    "SELECT count(*) FROM rqt_range(NULL, 4, 'plain', '{\"max_vertices\":50}')",
    "SELECT rqt_block_check(data), rqt_block_info(data), length(rqt_block_dump(data)) FROM rqt_block_1 LIMIT 20",
    "SELECT * FROM v",
};

const long fuzz_runs = 120;

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static unsigned char *image;
    static sqlite3_int64 length;
    input in = {data, size};
    if (!image) {
        sqlite3 *sound = fuzz_database();
        image = sqlite3_serialize(sound, "main", &length, 0);
        HOLD(image && sqlite3_close(sound) == SQLITE_OK, "image");
    }
    sqlite3 *db = fuzz_connect();
    unsigned char *copy = sqlite3_malloc64((sqlite3_uint64)length);
    if (!copy) abort();
    memcpy(copy, image, (size_t)length);
    const int way = take_between(&in, 0, 2);
    for (int n = way ? 0 : take_between(&in, 1, 12); n > 0; n--)
        copy[take_bits(&in, 4) % (uint64_t)length] = (unsigned char)take_bits(&in, 1);
    HOLD(sqlite3_deserialize(db, "main", copy, length, length,
                             SQLITE_DESERIALIZE_FREEONCLOSE | SQLITE_DESERIALIZE_RESIZEABLE) == SQLITE_OK,
         "deserialize");
    long patience = 300;
    sqlite3_progress_handler(db, 1000, fuzz_patience, &patience);
    for (int n = way ? take_between(&in, 1, 3) : 0; n > 0; n--) {
        char value[800], sql[2000];
        take_value(&in, value, sizeof value);
        (void)snprintf(sql, sizeof sql,
                       edits[take_between(&in, 0, 2) ? take_bits(&in, 1) % (sizeof edits / sizeof *edits) : 0],
                       columns[take_bits(&in, 1) % (sizeof columns / sizeof *columns)], value);
        (void)sqlite3_exec(db, sql, NULL, NULL, NULL);
    }
    if (!sqlite3_get_autocommit(db)) (void)sqlite3_exec(db, "ROLLBACK", NULL, NULL, NULL);
    (void)sqlite3_db_config(db, SQLITE_DBCONFIG_TRUSTED_SCHEMA, take_between(&in, 0, 1), NULL);
    const int changes = sqlite3_total_changes(db);
    for (int n = 0; n < 4; n++) {
        const char *sql = questions[take_bits(&in, 1) % (sizeof questions / sizeof *questions)];
        sqlite3_stmt *s = NULL;
        patience = 300;
        if (sqlite3_prepare_v2(db, sql, -1, &s, NULL) == SQLITE_OK) (void)fuzz_ask(db, sql, s);
        sqlite3_finalize(s);
        HOLD(sqlite3_get_autocommit(db) && sqlite3_total_changes(db) == changes, "%s changes something", sql);
    }
    HOLD(sqlite3_close(db) == SQLITE_OK, "the connection does not close");
    return 0;
}
